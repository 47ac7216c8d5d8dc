#include "shared/wire/frame.hpp"

#include <array>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

// Offsets in the header; numbers are little-endian, but for the CRC.
constexpr std::size_t kVersionAt = 0;
constexpr std::size_t kPriorityAt = 1;
constexpr std::size_t kSourceAt = 2;
constexpr std::size_t kDestinationAt = 4;
constexpr std::size_t kSpecifierAt = 6;
constexpr std::size_t kTransferIdAt = 8;
constexpr std::size_t kIndexAt = 16;
constexpr std::size_t kUserDataAt = 20;
constexpr std::size_t kCrcAt = 22;

constexpr std::uint8_t kVersion = 1;
constexpr std::uint32_t kSingleFrame = 0x80000000u;  // frame index 0, end of transfer

template <class Unsigned>
void store(std::span<std::uint8_t> out, std::size_t at, Unsigned value) {
  for (std::size_t i = 0; i < sizeof(Unsigned); ++i)
    out[at + i] = static_cast<std::uint8_t>((std::uint64_t{value} >> (8 * i)) & 0xFFu);
}

template <class Unsigned>
Unsigned load(std::span<const std::uint8_t> in, std::size_t at) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Unsigned); ++i) value |= std::uint64_t{in[at + i]} << (8 * i);
  return static_cast<Unsigned>(value);
}

}  // namespace

void write_header(const FrameHeader& header, std::span<std::uint8_t, kHeaderBytes> out) {
  out[kVersionAt] = kVersion;
  out[kPriorityAt] = static_cast<std::uint8_t>(header.priority);
  store(out, kSourceAt, header.source);
  store(out, kDestinationAt, header.destination);
  store(out, kSpecifierAt, header.specifier);
  store(out, kTransferIdAt, header.transfer_id);
  store(out, kIndexAt, kSingleFrame);
  store(out, kUserDataAt, std::uint16_t{0});
  const std::uint16_t crc = crc16(out.first<kCrcAt>());
  out[kCrcAt] = static_cast<std::uint8_t>(crc >> 8);
  out[kCrcAt + 1] = static_cast<std::uint8_t>(crc & 0xFFu);
}

Status parse_header(std::span<const std::uint8_t, kHeaderBytes> bytes, FrameHeader& header) {
  if (crc16(bytes) != 0) return Status::header_crc_mismatch;
  if (bytes[kVersionAt] != kVersion) return Status::header_version_unknown;
  if (bytes[kPriorityAt] > static_cast<std::uint8_t>(Priority::optional))
    return Status::header_version_unknown;
  if (load<std::uint32_t>(bytes, kIndexAt) != kSingleFrame) return Status::not_a_single_frame;
  header.priority = static_cast<Priority>(bytes[kPriorityAt]);
  header.source = load<std::uint16_t>(bytes, kSourceAt);
  header.destination = load<std::uint16_t>(bytes, kDestinationAt);
  header.specifier = load<std::uint16_t>(bytes, kSpecifierAt);
  header.transfer_id = load<std::uint64_t>(bytes, kTransferIdAt);
  return Status::ok;
}

std::size_t encode_frame(const FrameHeader& header, std::span<const std::uint8_t> payload,
                         std::span<std::uint8_t> out) {
  if (out.size() < 2) return 0;
  std::array<std::uint8_t, kHeaderBytes> header_bytes;
  write_header(header, header_bytes);
  std::array<std::uint8_t, kPayloadCrcBytes> crc_bytes;
  store(crc_bytes, 0, crc32c_value(crc32c_update(kCrc32cInitial, payload)));

  CobsEncoder cobs(out.subspan(1, out.size() - 2));
  cobs.put(header_bytes);
  cobs.put(payload);
  cobs.put(crc_bytes);
  const std::size_t encoded = cobs.finish();
  if (encoded == 0) return 0;
  out[0] = kCobsDelimiter;
  out[1 + encoded] = kCobsDelimiter;
  return encoded + 2;
}

}  // namespace palpate::wire
