// A CAN bus in virtual time, between host and board: one bus that both directions share, frame by frame.
// Bytes are CAN records (shared/wire/can_record.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "host/link/bus_direction.hpp"
#include "host/link/bus_errors.hpp"
#include "host/link/can_cost.hpp"
#include "shared/wire/can_record.hpp"

namespace palpate::link {

// A frame takes can_frame_s(), the longest that it may: with all stuff bits. When the bus is free, the frame
// with the least identifier of all that wait goes next, of equal ones the oldest; a frame on its way is not
// interrupted. That is a bus whose controllers hold all that waits sorted by identifier, as Cyphal asks of
// them. Nobody else is on the bus.
//
// A frame that an error hits is lost for all nodes; its sender tries again, in competition with what waits by
// then. ISO 11898-1: the attempt takes the whole frame at most, for its CRC is judged at its end; then 6 bits
// of error flag, up to 6 more of the others' and 8 of delimiter. The sender counts 8 for each error and takes
// off one for each frame that goes through; beyond 255 it is off the bus, until 128 times 11 bits have
// passed. What waits in it stays there, as in a driver that restarts its controller by itself.
//
// The ticks given to either direction never decrease, those of both taken together. What is handed over at a
// tick competes with all else of that tick, in whatever order the calls came. One thread.
class MeteredCanBus {
 public:
  // `queue_limit_bytes`: most bytes that may wait for their arrival, of each direction. Throws
  // std::invalid_argument if a bit time is not positive, the limit is 0, or a chance is out of its range.
  explicit MeteredCanBus(const CanBus& bus, std::size_t queue_limit_bytes = 1u << 20, BusErrors errors = {});
  MeteredCanBus(const MeteredCanBus&) = delete;
  MeteredCanBus& operator=(const MeteredCanBus&) = delete;

  // A submission need not end with a whole record: the rest of it may come with the next one. Bytes that are
  // no record, and frames in FD format on a classic bus, are dropped and counted.
  Medium& down() { return down_; }  // host to board
  Medium& up() { return up_; }      // board to host

 private:
  friend class BusDirection<MeteredCanBus>;
  static constexpr std::size_t kDirections = 2;

  struct Record {
    std::size_t direction = 0;
    std::uint64_t submitted_ns = 0;
    std::uint64_t duration_ns = 0;
    std::uint64_t end_ns = 0;  // of its time on the bus
    std::vector<std::uint8_t> bytes;
  };
  struct State {
    std::map<std::pair<std::uint32_t, std::uint64_t>, Record> waiting;  // by identifier, then by age
    std::array<std::deque<Record>, kDirections> sent;                   // not delivered
    std::uint64_t free_at_ns = 0;
    std::uint64_t now_ns = 0;
    struct Sender {
      std::uint32_t error_count = 0;
      std::uint64_t off_until_ns = 0;
      std::uint64_t to_fail = 0;  // attempts
      std::uint64_t attempts_failed = 0, bus_offs = 0;
    };
    std::array<Sender, kDirections> senders{};
    std::uint64_t attempts = 0;
    [[nodiscard]] std::size_t backlog_bytes(std::size_t direction) const;
  };
  using Waiting = decltype(State::waiting);
  // Sends what goes out before `to_ns`.
  void advance(State& state, std::uint64_t to_ns) const;
  // The record that goes next, and when.
  static std::pair<Waiting::iterator, std::uint64_t> next(State& state);
  [[nodiscard]] bool is_hit(const State& state, std::size_t direction, std::uint64_t start_ns) const;
  void advance(std::uint32_t tick);
  bool submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick);
  std::vector<std::uint8_t> deliver(std::size_t direction, std::uint32_t tick);
  [[nodiscard]] std::size_t backlog_bytes(std::size_t direction, std::uint32_t tick) const;
  // With full frames.
  [[nodiscard]] double bytes_per_tick() const;
  [[nodiscard]] MediumCounters counters(std::size_t direction) const;
  void fail_attempts(std::size_t direction, std::uint64_t count) {
    state_.senders[direction].to_fail += count;
  }

  CanBus bus_;
  std::size_t queue_limit_bytes_;
  BusErrors errors_;
  State state_;
  std::uint64_t records_ = 0;
  struct Side {
    wire::CanRecordReader reader;
    std::uint64_t bytes_accepted = 0, bytes_delivered = 0, bytes_dropped = 0, submissions_dropped = 0;
    std::uint64_t busy_ns = 0;
  };
  std::array<Side, kDirections> sides_;
  BusDirection<MeteredCanBus> down_{*this, 0}, up_{*this, 1};
};

}  // namespace palpate::link
