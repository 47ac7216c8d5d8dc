#include "host/link/usb_bus.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::link {
namespace {

// The first instant from `earliest` on at which a transaction may begin that takes `duration`.
std::uint64_t begin_of(std::uint64_t earliest, std::uint64_t duration) {
  const std::uint64_t frame = earliest / kUsbFrameBytes * kUsbFrameBytes;
  const std::uint64_t begin = std::max(earliest, frame + kUsbStartOfFrameBytes);
  return begin + duration <= frame + kUsbFrameBytes ? begin : frame + kUsbFrameBytes + kUsbStartOfFrameBytes;
}

}  // namespace

MeteredUsbBus::MeteredUsbBus(std::size_t queue_limit_bytes) : queue_limit_bytes_(queue_limit_bytes) {
  if (queue_limit_bytes == 0)
    throw std::invalid_argument("MeteredUsbBus: queue_limit_bytes is 0; at least 1 is needed");
}

// Since advance() is called for each tick at which something is submitted, all that waits here has been
// submitted by `now`.
void MeteredUsbBus::State::advance(std::uint64_t to) {
  for (;;) {
    if (waiting[turn].empty()) turn = 1 - turn;
    if (waiting[turn].empty()) break;
    Transfer& transfer = waiting[turn].front();
    const std::size_t count = std::min(kUsbPacketBytes, transfer.bytes.size() - transfer.sent);
    const std::uint64_t duration = kUsbTransactionOverheadBytes + count;
    const std::uint64_t begin = begin_of(std::max(free_at, now), duration);
    if (begin >= to) break;
    const auto first = transfer.bytes.begin() + static_cast<std::ptrdiff_t>(transfer.sent);
    free_at = begin + duration;
    sent[turn].push_back(
        {.bytes = {first, first + static_cast<std::ptrdiff_t>(count)}, .end = free_at, .duration = duration});
    transfer.sent += count;
    if (count < kUsbPacketBytes) waiting[turn].pop_front();
    turn = 1 - turn;
  }
  now = to;
}

std::size_t MeteredUsbBus::State::backlog_bytes(std::size_t direction) const {
  std::size_t bytes = 0;
  for (const Transfer& transfer : waiting[direction]) bytes += transfer.bytes.size() - transfer.sent;
  for (const Packet& packet : sent[direction])
    if (packet.end > now) bytes += packet.bytes.size();
  return bytes;
}

void MeteredUsbBus::advance(std::uint32_t tick) {
  const std::uint64_t to = tick * kUsbFrameBytes;
  if (to < state_.now)
    throw std::invalid_argument("MeteredUsbBus: tick " + std::to_string(tick) + " comes after tick " +
                                std::to_string(state_.now / kUsbFrameBytes) + "; ticks must not decrease");
  state_.advance(to);
}

bool MeteredUsbBus::submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  advance(tick);
  if (bytes.empty()) return true;
  Side& side = sides_[direction];
  if (state_.backlog_bytes(direction) + bytes.size() > queue_limit_bytes_) {
    ++side.submissions_dropped;
    side.bytes_dropped += bytes.size();
    return false;
  }
  side.bytes_accepted += bytes.size();
  state_.waiting[direction].push_back({.bytes = {bytes.begin(), bytes.end()}, .sent = 0});
  return true;
}

std::vector<std::uint8_t> MeteredUsbBus::deliver(std::size_t direction, std::uint32_t tick) {
  advance(tick);
  Side& side = sides_[direction];
  std::vector<std::uint8_t> out;
  std::deque<Packet>& sent = state_.sent[direction];
  for (; !sent.empty() && sent.front().end <= state_.now; sent.pop_front()) {
    out.insert(out.end(), sent.front().bytes.begin(), sent.front().bytes.end());
    side.busy += sent.front().duration;
  }
  side.bytes_delivered += out.size();
  return out;
}

std::size_t MeteredUsbBus::backlog_bytes(std::size_t direction, std::uint32_t tick) const {
  if (tick * kUsbFrameBytes <= state_.now) return state_.backlog_bytes(direction);
  State later = state_;
  later.advance(tick * kUsbFrameBytes);
  return later.backlog_bytes(direction);
}

MediumCounters MeteredUsbBus::counters(std::size_t direction) const {
  const Side& side = sides_[direction];
  return {.bytes_accepted = side.bytes_accepted,
          .bytes_delivered = side.bytes_delivered,
          .bytes_dropped = side.bytes_dropped,
          .submissions_dropped = side.submissions_dropped,
          .busy_ticks = static_cast<double>(side.busy) / static_cast<double>(kUsbFrameBytes)};
}

}  // namespace palpate::link
