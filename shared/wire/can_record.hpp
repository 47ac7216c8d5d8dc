// CAN frames as bytes, for links that are byte streams. One record a frame:
//   u32 little-endian: identifier in bits 28..0, bit 29 zero, bit 30 set in FD format, bit 31 set
//   u8: length code of the data in bits 3..0, its complement in bits 7..4
//   data, tail byte included
//   u16 big-endian: CRC-16/CCITT-FALSE of all bytes before
// The check stands for the CRC that a bus's controllers put on each frame: a damaged record is a lost frame,
// as it is there, and a reader finds the next record behind bytes that are none.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/wire/can_frame.hpp"

namespace palpate::wire {

inline constexpr std::size_t kCanRecordHeadBytes = 5;
inline constexpr std::size_t kCanRecordCheckBytes = 2;
inline constexpr std::size_t kCanRecordOverheadBytes = kCanRecordHeadBytes + kCanRecordCheckBytes;
inline constexpr std::size_t kMaxCanRecordBytes = 64 + kCanRecordOverheadBytes;

// Writes one record; returns its length. 0: `out` is too small, or identifier or length of data are none of
// CAN's; nothing is written. Any context.
std::size_t write_can_record(const CanFrame& frame, std::span<std::uint8_t> out);

// Bytes to CAN frames. Bytes that are no record are passed over, one by one, until a record begins. Any
// context, one owner.
class CanRecordReader {
 public:
  enum class Found : std::uint8_t {
    nothing,  // all bytes are taken
    frame,    // a whole record: `frame`, whose data lie in the reader until the next call
    damage,   // bytes that are no record begin here: told once, until a good record
  };
  struct Step {
    std::size_t consumed = 0;  // bytes taken from the front of the input
    Found found = Found::nothing;
    CanFrame frame{};
  };
  // Call again with the rest, even if that is empty, until nothing is found: behind damage the reader may
  // hold more than one record. A byte of a good stream is looked at once, a byte behind damage at most
  // kMaxCanRecordBytes times.
  Step read(std::span<const std::uint8_t> bytes);
  // Bytes taken that no frame has been made of so far.
  [[nodiscard]] std::size_t held_bytes() const { return length_ - done_; }

 private:
  [[nodiscard]] bool head_possible(std::size_t at) const;
  void drop(std::size_t bytes);

  std::array<std::uint8_t, kMaxCanRecordBytes> held_{};
  std::size_t length_ = 0;  // bytes in held_, which begin with a record
  std::size_t done_ = 0;    // bytes at their front that were told already
  bool lost_ = false;       // no good record since the last damage
};

}  // namespace palpate::wire
