#include "host/link/uart.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace palpate::link {
namespace {

constexpr std::uint64_t kBitsPerByte = 10;
constexpr std::uint64_t kUnitsPerByte = kBitsPerByte * kTicksPerSecond;

void check_tick(std::uint32_t tick, std::uint32_t last_tick) {
  if (tick < last_tick)
    throw std::invalid_argument("Uart: tick " + std::to_string(tick) + " comes after tick " +
                                std::to_string(last_tick) + "; ticks must not decrease");
}

}  // namespace

Uart::Uart(std::uint32_t baud, std::size_t queue_limit_bytes)
    : baud_(baud), queue_limit_bytes_(queue_limit_bytes) {
  if (baud < kMinBaud || baud > kMaxBaud)
    throw std::invalid_argument("Uart: baud " + std::to_string(baud) + " is not in " +
                                std::to_string(kMinBaud) + ".." + std::to_string(kMaxBaud));
  if (queue_limit_bytes == 0)
    throw std::invalid_argument("Uart: queue_limit_bytes is 0; at least 1 is needed");
}

std::uint64_t Uart::instant(std::uint32_t tick) const {
  return std::uint64_t{tick} * baud_;
}

std::size_t Uart::arrived(const Burst& burst, std::uint64_t now) const {
  if (now <= burst.start) return 0;
  return std::min<std::size_t>((now - burst.start) / kUnitsPerByte, burst.bytes.size());
}

bool Uart::submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  check_tick(tick, last_tick_);
  last_tick_ = tick;
  if (bytes.empty()) return true;
  if (backlog_bytes(tick) + bytes.size() > queue_limit_bytes_) {
    ++submissions_dropped_;
    bytes_dropped_ += bytes.size();
    return false;
  }
  const std::uint64_t start = std::max(free_at_, instant(tick));
  if (start == free_at_ && !bursts_.empty()) {
    bursts_.back().bytes.insert(bursts_.back().bytes.end(), bytes.begin(), bytes.end());
  } else {
    bursts_.push_back({start, {bytes.begin(), bytes.end()}});
  }
  free_at_ = start + kUnitsPerByte * bytes.size();
  bytes_accepted_ += bytes.size();
  return true;
}

std::vector<std::uint8_t> Uart::deliver(std::uint32_t tick) {
  check_tick(tick, last_tick_);
  last_tick_ = tick;
  const std::uint64_t now = instant(tick);
  std::vector<std::uint8_t> out;
  while (!bursts_.empty()) {
    Burst& burst = bursts_.front();
    const std::size_t up_to = arrived(burst, now);
    out.insert(out.end(), burst.bytes.begin() + static_cast<std::ptrdiff_t>(burst.delivered),
               burst.bytes.begin() + static_cast<std::ptrdiff_t>(up_to));
    burst.delivered = up_to;
    if (up_to < burst.bytes.size()) break;
    bursts_.pop_front();
  }
  bytes_delivered_ += out.size();
  return out;
}

std::size_t Uart::backlog_bytes(std::uint32_t tick) const {
  const std::uint64_t now = instant(tick);
  std::size_t bytes = 0;
  for (const Burst& burst : bursts_) bytes += burst.bytes.size() - arrived(burst, now);
  return bytes;
}

double Uart::bytes_per_tick() const {
  return static_cast<double>(baud_) / static_cast<double>(kUnitsPerByte);
}

MediumCounters Uart::counters() const {
  return {.bytes_accepted = bytes_accepted_,
          .bytes_delivered = bytes_delivered_,
          .bytes_dropped = bytes_dropped_,
          .submissions_dropped = submissions_dropped_,
          .busy_ticks = static_cast<double>(bytes_delivered_ * kUnitsPerByte) / static_cast<double>(baud_)};
}

}  // namespace palpate::link
