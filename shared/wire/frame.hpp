// Cyphal/serial frames: 00 | COBS(header 24 bytes | payload | CRC-32C of the payload) | 00. One transfer is
// one frame. Source: OpenCyphal's Cyphal/serial, header version 1, as pycyphal 1.27 writes it
// (docs/protocol.md has the layout).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/status.hpp"
#include "shared/wire/cobs.hpp"
#include "shared/wire/ports.hpp"

namespace palpate::wire {

// Values travel over the link: never renumber them.
enum class Priority : std::uint8_t {
  exceptional = 0,
  immediate = 1,
  fast = 2,
  high = 3,
  nominal = 4,
  low = 5,
  slow = 6,
  optional = 7,
};

struct FrameHeader {
  Priority priority = Priority::nominal;
  std::uint16_t source = kBroadcast;
  std::uint16_t destination = kBroadcast;
  std::uint16_t specifier = 0;  // ports.hpp
  std::uint64_t transfer_id =
      0;  // counts transfers of this source and specifier; a response repeats its request's
  bool operator==(const FrameHeader&) const = default;
};

// A received frame. `payload` points into the receiver's buffer, 8-byte aligned, without its CRC.
struct Frame {
  FrameHeader header;
  std::span<const std::uint8_t> payload;
};

inline constexpr std::size_t kHeaderBytes = 24;
inline constexpr std::size_t kPayloadCrcBytes = 4;
inline constexpr std::size_t kFrameOverheadBytes = kHeaderBytes + kPayloadCrcBytes;

// Largest frame on the wire with this payload, both delimiters included.
constexpr std::size_t max_frame_bytes(std::size_t payload_bytes) {
  return cobs_max_bytes(payload_bytes + kFrameOverheadBytes) + 2;
}

// True if a frame with this destination concerns node `node`.
constexpr bool addressed_to(const FrameHeader& header, std::uint16_t node) {
  return header.destination == node || header.destination == kBroadcast;
}

// Header to bytes and back. parse_header: Status::header_crc_mismatch, header_version_unknown (version, or a
// priority beyond 7), not_a_single_frame; `header` is written only with Status::ok. Any context.
void write_header(const FrameHeader& header, std::span<std::uint8_t, kHeaderBytes> out);
Status parse_header(std::span<const std::uint8_t, kHeaderBytes> bytes, FrameHeader& header);

// Encodes one frame with both delimiters. Returns its length; 0: `out` is too small (max_frame_bytes() always
// suffices), and what it holds is no frame. `payload` must not overlap `out`. Any context.
std::size_t encode_frame(const FrameHeader& header, std::span<const std::uint8_t> payload,
                         std::span<std::uint8_t> out);

}  // namespace palpate::wire
