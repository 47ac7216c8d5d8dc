// A UART with 8 data bits, no parity, 1 stop bit: 10 bit times a byte, bytes back to back while there are
// any.
#pragma once

#include <deque>

#include "host/link/medium.hpp"

namespace palpate::link {

// 20 Mbaud are 2,000 bytes a tick, just below what the lock-step exchange carries
// (boards/lockstep/exchange.hpp).
inline constexpr std::uint32_t kMinBaud = 1200;
inline constexpr std::uint32_t kMaxBaud = 20'000'000;

class Uart final : public Medium {
 public:
  // `queue_limit_bytes`: most bytes that may wait for their arrival. Throws std::invalid_argument if baud is
  // out of range or the limit is 0.
  explicit Uart(std::uint32_t baud, std::size_t queue_limit_bytes = 1u << 20);

  bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) override;
  std::vector<std::uint8_t> deliver(std::uint32_t tick) override;
  [[nodiscard]] std::size_t backlog_bytes(std::uint32_t tick) const override;
  [[nodiscard]] double bytes_per_tick() const override;
  [[nodiscard]] MediumCounters counters() const override;

 private:
  // Bytes sent without a pause; byte i has arrived at start + (i + 1) * (units of a byte).
  struct Burst {
    std::uint64_t start;
    std::vector<std::uint8_t> bytes;
    std::size_t delivered = 0;
  };
  [[nodiscard]] std::uint64_t instant(std::uint32_t tick) const;
  [[nodiscard]] std::size_t arrived(const Burst& burst, std::uint64_t now) const;

  std::uint32_t baud_;
  std::size_t queue_limit_bytes_;
  // Time is counted in units of 1 / (baud * kTicksPerSecond) s, in which a tick and a bit are both whole: no
  // drift.
  std::uint64_t free_at_ = 0;  // when the last byte submitted will have arrived
  std::uint32_t last_tick_ = 0;
  std::deque<Burst> bursts_;
  std::uint64_t bytes_accepted_ = 0, bytes_delivered_ = 0, bytes_dropped_ = 0, submissions_dropped_ = 0;
};

}  // namespace palpate::link
