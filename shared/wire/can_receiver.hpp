// CAN frames in, whole transfers out. Transfers of different ports and sources may come interleaved, as the
// arbitration of a bus makes them. A fault costs the transfer that it hits and is counted.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/wire/can_frame.hpp"
#include "shared/wire/can_record.hpp"
#include "shared/wire/reception.hpp"

namespace palpate::wire {

// A transfer whose next frame does not come within this time is given up (Cyphal's transfer-ID timeout, 2 s).
inline constexpr std::uint32_t kCanTransferTimeout_ticks = 2000;
// What a buffer holds beyond the payload: CRC, and the zeros that pad an FD frame (48 bytes to 64).
inline constexpr std::size_t kCanReassemblyOverheadBytes = kCanTransferCrcBytes + 15;

// Room for a transfer in several frames.
inline constexpr std::uint16_t kAnySpecifier = 0xFFFF;  // none that CAN can name
struct CanRoom {
  std::uint16_t capacity = 0;               // bytes of payload
  std::uint16_t specifier = kAnySpecifier;  // kept for transfers under this one
};
// Bytes of buffer for it: parts begin where 8-byte numbers may.
constexpr std::size_t can_room_bytes(const CanRoom& room) {
  return (room.capacity + kCanReassemblyOverheadBytes + 7) / 8 * 8;
}

// A transfer in several frames, as far as it has come.
struct CanReassembly {
  enum class State : std::uint8_t {
    unused,
    open,
    refused,   // counted as a fault; the rest of its frames are passed over
    complete,  // delivered; remembered to know its last frame when that comes again
  };
  State state = State::unused;
  bool next_toggle = false;
  std::uint8_t transfer_id = 0;
  std::uint8_t frame_bytes = 0;  // data of each frame but the last
  std::uint16_t crc = 0;
  std::uint16_t length = 0;      // bytes so far
  std::uint32_t identifier = 0;  // of all its frames
  std::uint32_t last_tick = 0;   // of its last frame
};

// Works in the memory that it is given. Use CanReceiver.
class CanDecoder {
 public:
  // As many entries in `transfers` as in `rooms`; `buffer` of all can_room_bytes() together. `node`:
  // transfers to another one are passed over; kBroadcast takes all.
  CanDecoder(std::span<const CanRoom> rooms, std::span<CanReassembly> transfers,
             std::span<std::uint8_t> buffer, std::uint16_t node)
      : rooms_(rooms), transfers_(transfers), buffer_(buffer), node_(node) {}
  CanDecoder(const CanDecoder&) = delete;
  CanDecoder& operator=(const CanDecoder&) = delete;

  // Takes one frame. True: it completed `out`, whose transfer identifier has 5 bits, and whose payload may
  // have zeros behind it on CAN FD; valid until the next call. `now_tick` may wrap. Any context, one owner.
  bool take(const CanFrame& frame, std::uint32_t now_tick, Frame& out);
  // The same from a stream of records (can_record.hpp): takes bytes up to the end of the next whole transfer,
  // or all of them. Call again with the rest until that is empty and nothing was complete.
  Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t now_tick);
  [[nodiscard]] const ReceiverCounters& counters() const { return counters_; }

 private:
  // A frame taken apart.
  struct Part {
    std::uint32_t identifier = 0;
    std::uint16_t specifier = 0;
    CanTail tail{};
    std::span<const std::uint8_t> content{};  // data without the tail byte
    std::uint32_t tick = 0;
  };
  [[nodiscard]] CanReassembly* find(std::uint32_t identifier);
  [[nodiscard]] bool may_hold(const CanReassembly& transfer, std::uint16_t specifier) const;
  [[nodiscard]] bool any_may_hold(std::uint16_t specifier) const;
  CanReassembly* room_for_a_start(const Part& part);
  CanReassembly* room_for_a_stray(const Part& part);
  [[nodiscard]] std::span<std::uint8_t> bytes_of(const CanReassembly& transfer) const;
  [[nodiscard]] bool repeats(const CanReassembly& transfer, const Part& part) const;
  void refuse(CanReassembly& transfer, const Part& part, Status fault);
  void start(const Part& part);
  CanReassembly* proceed(const Part& part);
  void append(CanReassembly& transfer, const Part& part);

  std::span<const CanRoom> rooms_;
  std::span<CanReassembly> transfers_;
  std::span<std::uint8_t> buffer_;
  std::uint16_t node_;
  alignas(8) std::array<std::uint8_t, 64> single_{};
  CanRecordReader records_;
  ReceiverCounters counters_{};
};

// A CanDecoder with its memory: `Rooms` is a std::array of CanRoom. Transfers in several frames that no room
// may hold are passed over: other nodes' business.
template <auto Rooms>
class CanRoomsReceiver {
  static constexpr auto kRooms = Rooms;
  static constexpr std::size_t kBufferBytes = [] {
    std::size_t bytes = 0;
    for (const CanRoom& room : kRooms) bytes += can_room_bytes(room);
    return bytes;
  }();
  static_assert(std::all_of(kRooms.begin(), kRooms.end(),
                            [](const CanRoom& room) { return can_room_bytes(room) <= 0xFFFF; }),
                "lengths are counted in 16 bits");

 public:
  explicit CanRoomsReceiver(std::uint16_t node = kBroadcast) : decoder_(kRooms, transfers_, buffer_, node) {}
  bool take(const CanFrame& frame, std::uint32_t now_tick, Frame& out) {
    return decoder_.take(frame, now_tick, out);
  }
  Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t now_tick) {
    return decoder_.receive(bytes, now_tick);
  }
  [[nodiscard]] const ReceiverCounters& counters() const { return decoder_.counters(); }

 private:
  std::array<CanReassembly, kRooms.size()> transfers_{};
  alignas(8) std::array<std::uint8_t, kBufferBytes> buffer_{};
  CanDecoder decoder_;
};

template <std::size_t Capacity, std::size_t AtOnce>
consteval std::array<CanRoom, AtOnce> equal_can_rooms() {
  static_assert(Capacity <= 0xFFFF, "lengths are counted in 16 bits");
  std::array<CanRoom, AtOnce> rooms{};
  rooms.fill({.capacity = Capacity});
  return rooms;
}
// The same for payloads of up to `Capacity` bytes, `AtOnce` of them at a time, of anybody.
template <std::size_t Capacity, std::size_t AtOnce>
using CanReceiver = CanRoomsReceiver<equal_can_rooms<Capacity, AtOnce>()>;

}  // namespace palpate::wire
