// Cyphal/CAN 1.0 frames, classic and FD: what of a transfer stands in the 29-bit identifier and in the tail
// byte, the last of each frame's data. Source: OpenCyphal's Cyphal/CAN as pycyphal 1.27 writes it
// (docs/protocol.md has the layout).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/status.hpp"
#include "shared/wire/frame.hpp"

namespace palpate::wire {

enum class CanFormat : std::uint8_t {
  classic,  // up to 8 bytes of data a frame
  fd,       // up to 64, at the data bit rate
};

constexpr std::size_t can_mtu(CanFormat format) {
  return format == CanFormat::fd ? 64 : 8;
}
inline constexpr std::size_t kCanTailBytes = 1;
inline constexpr std::size_t kCanTransferCrcBytes = 2;  // at the end of a transfer in several frames
inline constexpr unsigned kCanTransferIdBits = 5;
inline constexpr std::uint64_t kCanTransferIdMask = 31;
inline constexpr std::uint16_t kMaxCanNode = 127;
inline constexpr std::uint16_t kMaxCanSubject = 8191;
inline constexpr std::uint16_t kMaxCanService = 511;

// A frame on the bus. `data` includes the tail byte; its length is one of kCanDataLengths, on classic CAN at
// most 8.
struct CanFrame {
  std::uint32_t identifier = 0;  // 29 bits
  bool fd = false;               // in FD format, data at the data bit rate
  std::span<const std::uint8_t> data{};
};

// Lengths of data that a frame can have, by length code (ISO 11898-1: DLC).
inline constexpr std::array<std::uint8_t, 16> kCanDataLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                              8, 12, 16, 20, 24, 32, 48, 64};
// Least length code whose data hold so many bytes, 64 at most.
constexpr std::uint8_t can_length_code(std::size_t data_bytes) {
  std::uint8_t code = 0;
  while (kCanDataLengths[code] < data_bytes) ++code;
  return code;
}
constexpr std::size_t can_padded_bytes(std::size_t data_bytes) {
  return kCanDataLengths[can_length_code(data_bytes)];
}

struct CanTail {
  bool start = false;
  bool end = false;
  bool toggle = false;           // true in the first frame of a transfer, then alternating
  std::uint8_t transfer_id = 0;  // modulo 32
};
std::uint8_t can_tail_byte(const CanTail& tail);
CanTail parse_can_tail(std::uint8_t byte);

// Header to identifier and back, but for the transfer identifier. can_identifier: Status::not_for_can if
// source or destination is no node of CAN (only a message has no destination), or subject or service is
// beyond its bits; `identifier` is written only with Status::ok. parse_can_identifier:
// Status::header_version_unknown if reserved bits are set, as in frames of other protocols; a message of an
// anonymous node has source kBroadcast. Any context.
Status can_identifier(const FrameHeader& header, std::uint32_t& identifier);
Status parse_can_identifier(std::uint32_t identifier, FrameHeader& header);

}  // namespace palpate::wire
