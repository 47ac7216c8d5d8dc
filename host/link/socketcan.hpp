// A CAN bus through the kernel's drivers (SocketCAN, raw sockets). Bytes are records of
// shared/wire/can_record.hpp, one a frame on the bus.
//
// The interface is set up beforehand, as root:
//   ip link set can0 up type can bitrate 1000000 restart-ms 100                          classic
//   ip link set can0 up type can bitrate 1000000 dbitrate 5000000 fd on restart-ms 100   CAN FD
// Without restart-ms a controller that has gone off the bus stays off it until somebody restarts it
// (ip link set can0 type can restart).
#pragma once

#include <linux/can.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "host/link/can_errors.hpp"
#include "host/link/can_interface.hpp"
#include "host/link/descriptor_link.hpp"
#include "shared/wire/can_frame.hpp"

namespace palpate::link {

// write() takes whole records, in FD format only where the link is; otherwise std::invalid_argument, before
// that record is sent. While the controller is off the bus it takes nothing, as with a full queue. read()
// returns whole records of frames with 29-bit identifiers, those that other programs on this computer send
// among them, this link's own not. A link whose interface goes down or vanishes has gone.
class SocketCan final : public DescriptorLink {
 public:
  // Throws TransportError: no such interface, none of CAN, down, or of classic CAN only.
  SocketCan(const std::string& interface, wire::CanFormat format);

  std::vector<std::uint8_t> read(std::chrono::microseconds longest) override;
  [[nodiscard]] bool is_open() const override { return !gone_ && DescriptorLink::is_open(); }

  [[nodiscard]] FramingKind framing() const override {
    return fd_ ? FramingKind::can_fd : FramingKind::can_classic;
  }

  // As of now. Any thread.
  CanErrors errors();
  bool is_bus_off();
  [[nodiscard]] std::string trouble() override;

 protected:
  ssize_t put(std::span<const std::uint8_t> bytes) override;
  ssize_t get(std::span<std::uint8_t> bytes) override;

 private:
  SocketCan(const std::string& name, wire::CanFormat format, const CanInterface& interface);
  void take_errors();

  bool fd_;
  Descriptor error_socket_;
  std::mutex mutex_;  // of error_socket_ and what it told, below
  CanErrors errors_;
  bool is_bus_off_;
  std::atomic<std::uint32_t> frames_missed_{0};
  std::atomic<bool> gone_{false};
};

}  // namespace palpate::link
