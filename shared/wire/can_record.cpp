#include "shared/wire/can_record.hpp"

#include <algorithm>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

constexpr std::uint32_t kIdentifierMask = (1u << 29) - 1;
// In the identifier's last byte: bits 31 to 29.
constexpr std::uint8_t kFlagMask = 0xE0, kAlways = 0x80, kFd = 0x40;
constexpr std::size_t kFlagsAt = 3;
constexpr std::size_t kLengthAt = 4;
constexpr std::uint8_t kLargestClassicCode = 8;

bool flags_possible(std::uint8_t byte) {
  return (byte & kFlagMask & ~kFd) == kAlways;
}

bool length_possible(std::uint8_t byte, bool fd) {
  const unsigned code = byte & 0xFu;
  return code == (~(unsigned{byte} >> 4) & 0xFu) && (fd || code <= kLargestClassicCode);
}

}  // namespace

std::size_t write_can_record(const CanFrame& frame, std::span<std::uint8_t> out) {
  const std::size_t data_bytes = frame.data.size(), record_bytes = data_bytes + kCanRecordOverheadBytes;
  if (data_bytes > can_mtu(frame.fd ? CanFormat::fd : CanFormat::classic)) return 0;
  const std::uint8_t code = can_length_code(data_bytes);
  if (kCanDataLengths[code] != data_bytes || (frame.identifier & ~kIdentifierMask) != 0) return 0;
  if (out.size() < record_bytes) return 0;
  for (std::size_t i = 0; i < 4; ++i)
    out[i] = static_cast<std::uint8_t>((frame.identifier >> (8 * i)) & 0xFFu);
  out[kFlagsAt] = static_cast<std::uint8_t>(out[kFlagsAt] | kAlways | (frame.fd ? kFd : 0u));
  out[kLengthAt] = static_cast<std::uint8_t>(code | ((~unsigned{code} & 0xFu) << 4));
  std::copy(frame.data.begin(), frame.data.end(), out.begin() + kCanRecordHeadBytes);
  const std::uint16_t check = crc16(out.first(record_bytes - kCanRecordCheckBytes));
  out[record_bytes - 2] = static_cast<std::uint8_t>(check >> 8);
  out[record_bytes - 1] = static_cast<std::uint8_t>(check & 0xFFu);
  return record_bytes;
}

// As far as the bytes held say.
bool CanRecordReader::head_possible(std::size_t at) const {
  if (length_ > at + kFlagsAt && !flags_possible(held_[at + kFlagsAt])) return false;
  if (length_ <= at + kLengthAt) return true;
  return length_possible(held_[at + kLengthAt], (held_[at + kFlagsAt] & kFd) != 0);
}

void CanRecordReader::drop(std::size_t bytes) {
  std::copy(held_.begin() + static_cast<std::ptrdiff_t>(bytes),
            held_.begin() + static_cast<std::ptrdiff_t>(length_), held_.begin());
  length_ -= bytes;
}

CanRecordReader::Step CanRecordReader::read(std::span<const std::uint8_t> bytes) {
  drop(done_);
  done_ = 0;
  Step step;
  // Ends: every turn takes bytes from the input or drops held ones.
  while (true) {
    bool good = head_possible(0);
    if (good) {
      const bool head = length_ >= kCanRecordHeadBytes;
      const std::size_t data_bytes = head ? kCanDataLengths[held_[kLengthAt] & 0xFu] : 0;
      const std::size_t needed = head ? data_bytes + kCanRecordOverheadBytes : kCanRecordHeadBytes;
      if (length_ < needed) {
        const std::size_t taken = std::min(needed - length_, bytes.size() - step.consumed);
        if (taken == 0) return step;
        std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(step.consumed), taken,
                    held_.begin() + static_cast<std::ptrdiff_t>(length_));
        length_ += taken;
        step.consumed += taken;
        continue;
      }
      const std::span<const std::uint8_t> record = std::span<const std::uint8_t>(held_).first(needed);
      good = crc16(record) == 0;
      if (good) {
        std::uint32_t identifier = 0;
        for (std::size_t i = 0; i < 4; ++i) identifier |= std::uint32_t{record[i]} << (8 * i);
        step.frame = {.identifier = identifier & kIdentifierMask,
                      .fd = (record[kFlagsAt] & kFd) != 0,
                      .data = record.subspan(kCanRecordHeadBytes, data_bytes)};
        step.found = Found::frame;
        done_ = needed;
        lost_ = false;
        return step;
      }
    }
    std::size_t next = 1;
    while (next < length_ && !head_possible(next)) ++next;
    drop(next);
    if (!lost_) {
      lost_ = true;
      step.found = Found::damage;
      return step;
    }
  }
}

}  // namespace palpate::wire
