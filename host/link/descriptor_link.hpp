// A link whose driver is a file descriptor: a serial line, a pseudo-terminal, a socket.
#pragma once

#include <atomic>
#include <string>

#include "host/link/transport.hpp"

namespace palpate::link {

// Owner of one file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  [[nodiscard]] int get() const { return value_; }

 private:
  int value_;
};

// Waits until the descriptor is ready for `events` (poll(2)); false: not within `longest`. A descriptor whose
// other end has gone is ready, too.
bool wait_for(int descriptor, short events, std::chrono::microseconds longest);

class DescriptorLink : public Transport {
 public:
  // `descriptor` must be non-blocking.
  DescriptorLink(Descriptor descriptor, std::string address, double bytes_per_s);

  bool write(std::span<const std::uint8_t> frame) override;
  std::vector<std::uint8_t> read(std::chrono::microseconds longest) override;
  [[nodiscard]] bool is_open() const override { return open_; }
  [[nodiscard]] std::string address() const override { return address_; }
  [[nodiscard]] double bytes_per_s() const override { return bytes_per_s_; }
  [[nodiscard]] TransportCounters counters() const override;

 protected:
  [[nodiscard]] int descriptor() const { return descriptor_.get(); }
  // One system call each; as write(2) and read(2) answer.
  virtual ssize_t put(std::span<const std::uint8_t> bytes);
  virtual ssize_t get(std::span<std::uint8_t> bytes);
  [[nodiscard]] virtual std::chrono::milliseconds write_patience() const { return kWritePatience; }
  // Is this errno of a call the end of the link?
  [[nodiscard]] virtual bool is_end(int error) const;

 private:
  Descriptor descriptor_;
  std::string address_;
  double bytes_per_s_;
  std::atomic<bool> open_{true};
  std::atomic<std::uint64_t> bytes_sent_{0}, bytes_received_{0}, frames_unsent_{0};
};

}  // namespace palpate::link
