#include "host/link/can_bus.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/link/can_record_bytes.hpp"

namespace palpate::link {
namespace {

// Whole nanoseconds: a bit at 1 Mbit/s has 1,000, at 8 Mbit/s 125, so that nothing drifts.
constexpr std::uint64_t kTick_ns = 1'000'000'000u / kTicksPerSecond;

// On a bus for CAN FD frames of classic format may go, too.
std::uint64_t frame_ns(CanBus bus, const wire::CanFrame& frame) {
  bus.fd = frame.fd;
  return static_cast<std::uint64_t>(std::llround(can_frame_s(bus, frame.data.size()) * 1e9));
}

constexpr double kErrorBits = 6 + 6 + 8;
constexpr std::uint32_t kErrorStep = 8, kMostErrors = 255;
constexpr double kBusOffBits = 128 * 11;

std::uint64_t bits_ns(const CanBus& bus, double bits) {
  return static_cast<std::uint64_t>(std::llround(bits * bus.nominal_bit_s * 1e9));
}

}  // namespace

MeteredCanBus::MeteredCanBus(const CanBus& bus, std::size_t queue_limit_bytes, BusErrors errors)
    : bus_(bus), queue_limit_bytes_(queue_limit_bytes), errors_(std::move(errors)) {
  check_bus_errors(errors_, "MeteredCanBus");
  if (!(bus.nominal_bit_s > 0.0) || !(bus.data_bit_s > 0.0))
    throw std::invalid_argument("MeteredCanBus: bit times of " + std::to_string(bus.nominal_bit_s) + " and " +
                                std::to_string(bus.data_bit_s) + " s; they must be positive");
  if (queue_limit_bytes == 0)
    throw std::invalid_argument("MeteredCanBus: queue_limit_bytes is 0; at least 1 is needed");
}

// Since advance() is called for each tick at which something is submitted, all that waits here has been
// submitted by now_ns: of the senders that are on the bus the first of the map may go as soon as it is free.
std::pair<MeteredCanBus::Waiting::iterator, std::uint64_t> MeteredCanBus::next(State& state) {
  auto best = state.waiting.end();
  std::uint64_t best_ns = 0;
  for (auto it = state.waiting.begin(); it != state.waiting.end(); ++it) {
    const std::uint64_t free_ns = std::max(state.free_at_ns, it->second.submitted_ns);
    const std::uint64_t off_until_ns = state.senders[it->second.direction].off_until_ns;
    const std::uint64_t start_ns = std::max(free_ns, off_until_ns);
    if (best == state.waiting.end() || start_ns < best_ns) {
      best = it;
      best_ns = start_ns;
    }
    if (off_until_ns <= free_ns) break;
  }
  return {best, best_ns};
}

bool MeteredCanBus::is_hit(const State& state, std::size_t direction, std::uint64_t start_ns) const {
  // Of all that may hit it at least one does.
  double passes = 1.0;
  for (const BusError& error : errors_.errors)
    if (error.direction == direction && start_ns >= error.first_tick * kTick_ns &&
        start_ns < error.end_tick * kTick_ns)
      passes *= 1.0 - error.chance;
  return passes < 1.0 && drawn(errors_.seed, state.attempts) >= passes;
}

void MeteredCanBus::advance(State& state, std::uint64_t to_ns) const {
  while (!state.waiting.empty()) {
    const auto [it, start_ns] = next(state);
    if (start_ns >= to_ns) break;
    Record& record = it->second;
    State::Sender& sender = state.senders[record.direction];
    state.free_at_ns = start_ns + record.duration_ns;
    ++state.attempts;
    const bool is_planned = sender.to_fail > 0;
    if (is_planned) --sender.to_fail;
    if (is_planned || is_hit(state, record.direction, start_ns)) {
      state.free_at_ns += bits_ns(bus_, kErrorBits);
      ++sender.attempts_failed;
      sender.error_count += kErrorStep;
      if (sender.error_count > kMostErrors) {
        sender.error_count = 0;
        ++sender.bus_offs;
        sender.off_until_ns = state.free_at_ns + bits_ns(bus_, kBusOffBits);
      }
      continue;
    }
    if (sender.error_count > 0) --sender.error_count;
    record.end_ns = state.free_at_ns;
    state.sent[record.direction].push_back(std::move(record));
    state.waiting.erase(it);
  }
  state.now_ns = to_ns;
}

std::size_t MeteredCanBus::State::backlog_bytes(std::size_t direction) const {
  std::size_t bytes = 0;
  for (const auto& [key, record] : waiting)
    if (record.direction == direction) bytes += record.bytes.size();
  for (const Record& record : sent[direction])
    if (record.end_ns > now_ns) bytes += record.bytes.size();
  return bytes;
}

void MeteredCanBus::advance(std::uint32_t tick) {
  const std::uint64_t to_ns = tick * kTick_ns;
  if (to_ns < state_.now_ns)
    throw std::invalid_argument("MeteredCanBus: tick " + std::to_string(tick) + " comes after tick " +
                                std::to_string(state_.now_ns / kTick_ns) + "; ticks must not decrease");
  advance(state_, to_ns);
}

bool MeteredCanBus::submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  advance(tick);
  Side& side = sides_[direction];
  if (backlog_bytes(direction, tick) + bytes.size() > queue_limit_bytes_) {
    ++side.submissions_dropped;
    side.bytes_dropped += bytes.size();
    return false;
  }
  std::size_t unsettled = side.reader.held_bytes() + bytes.size();
  while (true) {
    const wire::CanRecordReader::Step step = side.reader.read(bytes);
    bytes = bytes.subspan(step.consumed);
    if (step.found == wire::CanRecordReader::Found::nothing) break;
    if (step.found == wire::CanRecordReader::Found::damage || (step.frame.fd && !bus_.fd)) continue;
    std::vector<std::uint8_t> record = can_record_of(step.frame);
    unsettled -= record.size();
    side.bytes_accepted += record.size();
    state_.waiting.emplace(std::pair{step.frame.identifier, records_++},
                           Record{.direction = direction,
                                  .submitted_ns = state_.now_ns,
                                  .duration_ns = frame_ns(bus_, step.frame),
                                  .end_ns = 0,
                                  .bytes = std::move(record)});
  }
  const std::size_t dropped = unsettled - side.reader.held_bytes();
  if (dropped == 0) return true;
  ++side.submissions_dropped;
  side.bytes_dropped += dropped;
  return false;
}

std::vector<std::uint8_t> MeteredCanBus::deliver(std::size_t direction, std::uint32_t tick) {
  advance(tick);
  Side& side = sides_[direction];
  std::deque<Record>& sent = state_.sent[direction];
  std::vector<std::uint8_t> out;
  while (!sent.empty() && sent.front().end_ns <= state_.now_ns) {
    out.insert(out.end(), sent.front().bytes.begin(), sent.front().bytes.end());
    side.busy_ns += sent.front().duration_ns;
    sent.pop_front();
  }
  side.bytes_delivered += out.size();
  return out;
}

std::size_t MeteredCanBus::backlog_bytes(std::size_t direction, std::uint32_t tick) const {
  const std::size_t held = sides_[direction].reader.held_bytes();
  if (tick * kTick_ns <= state_.now_ns) return held + state_.backlog_bytes(direction);
  State later = state_;
  advance(later, tick * kTick_ns);
  return held + later.backlog_bytes(direction);
}

double MeteredCanBus::bytes_per_tick() const {
  const std::size_t data_bytes = wire::can_mtu(bus_.fd ? wire::CanFormat::fd : wire::CanFormat::classic);
  return static_cast<double>(data_bytes + wire::kCanRecordOverheadBytes) /
         (can_frame_s(bus_, data_bytes) * kTicksPerSecond);
}

MediumCounters MeteredCanBus::counters(std::size_t direction) const {
  const Side& side = sides_[direction];
  return {.bytes_accepted = side.bytes_accepted,
          .bytes_delivered = side.bytes_delivered,
          .bytes_dropped = side.bytes_dropped,
          .submissions_dropped = side.submissions_dropped,
          .attempts_failed = state_.senders[direction].attempts_failed,
          .bus_offs = state_.senders[direction].bus_offs,
          .busy_ticks = static_cast<double>(side.busy_ns) / static_cast<double>(kTick_ns)};
}

}  // namespace palpate::link
