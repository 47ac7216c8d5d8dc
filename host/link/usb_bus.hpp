// Bulk transfers of one full-speed USB device in virtual time: the bus carries one packet at a time, to the
// device or from it.
//
// USB 2.0 specification: full speed is 12 Mbit/s in frames of 1 ms, so 1,500 bytes a frame (8.4.3 and 5.3.3).
// A bulk transaction takes its data and 13 bytes (table 5-9: synchronization, packet identifiers, endpoint,
// CRC, pauses between packets), a data packet has at most 64 bytes, and none begins that would not end in its
// frame: at most 19 full packets a frame, 1,216 bytes. The frame itself begins with its start-of-frame
// packet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "host/link/bus_direction.hpp"

namespace palpate::link {

inline constexpr std::size_t kUsbPacketBytes = 64;
inline constexpr std::uint64_t kUsbFrameBytes = 1500;
inline constexpr std::uint64_t kUsbTransactionOverheadBytes = 13;
// Synchronization, identifier, frame number with CRC, end of packet: 35 bits (8.4.3, 7.1.13.2).
inline constexpr std::uint64_t kUsbStartOfFrameBytes = 5;
inline constexpr std::size_t kUsbPacketsPerFrame = 19;
static_assert(kUsbStartOfFrameBytes +
                  kUsbPacketsPerFrame * (kUsbPacketBytes + kUsbTransactionOverheadBytes) <=
              kUsbFrameBytes);
static_assert(kUsbStartOfFrameBytes +
                  (kUsbPacketsPerFrame + 1) * (kUsbPacketBytes + kUsbTransactionOverheadBytes) >
              kUsbFrameBytes);

// A submission is a transfer: packets of 64 bytes and a shorter one at its end, an empty one where the last
// was full. Both directions take turns while both have something. What is left out: stuff bits (table 5-9
// leaves them out, too; in random data 0.8 %), packets that are refused and repeated, other devices, and a
// host controller that plans each frame beforehand (then a transfer begins up to a frame later).
//
// Tick k is where frame k begins. The ticks given to either direction never decrease, those of both taken
// together. One thread.
class MeteredUsbBus {
 public:
  // `queue_limit_bytes`: most bytes that may wait for their arrival, of each direction. Throws
  // std::invalid_argument if it is 0.
  explicit MeteredUsbBus(std::size_t queue_limit_bytes = 1u << 20);
  MeteredUsbBus(const MeteredUsbBus&) = delete;
  MeteredUsbBus& operator=(const MeteredUsbBus&) = delete;

  Medium& down() { return down_; }  // host to board
  Medium& up() { return up_; }      // board to host

 private:
  friend class BusDirection<MeteredUsbBus>;
  static constexpr std::size_t kDirections = 2;

  // Times are counted in bytes of the bus, kUsbFrameBytes a tick: whole numbers, no drift.
  struct Transfer {
    std::vector<std::uint8_t> bytes;
    std::size_t sent = 0;
  };
  struct Packet {
    std::vector<std::uint8_t> bytes;
    std::uint64_t end = 0;
    std::uint64_t duration = 0;
  };
  struct State {
    std::array<std::deque<Transfer>, kDirections> waiting;
    std::array<std::deque<Packet>, kDirections> sent;  // not delivered
    std::uint64_t free_at = 0, now = 0;
    std::size_t turn = 0;
    // Sends what begins before `to`.
    void advance(std::uint64_t to);
    [[nodiscard]] std::size_t backlog_bytes(std::size_t direction) const;
  };
  struct Side {
    std::uint64_t bytes_accepted = 0, bytes_delivered = 0, bytes_dropped = 0, submissions_dropped = 0;
    std::uint64_t busy = 0;
  };
  void advance(std::uint32_t tick);
  bool submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick);
  std::vector<std::uint8_t> deliver(std::size_t direction, std::uint32_t tick);
  [[nodiscard]] std::size_t backlog_bytes(std::size_t direction, std::uint32_t tick) const;
  [[nodiscard]] double bytes_per_tick() const {
    return static_cast<double>(kUsbPacketsPerFrame * kUsbPacketBytes);
  }
  [[nodiscard]] MediumCounters counters(std::size_t direction) const;

  std::size_t queue_limit_bytes_;
  State state_;
  std::array<Side, kDirections> sides_;
  BusDirection<MeteredUsbBus> down_{*this, 0}, up_{*this, 1};
};

}  // namespace palpate::link
