// The checksums of Cyphal/serial, Cyphal/CAN and CAN records.
#pragma once

#include <cstdint>
#include <span>

namespace palpate::wire {

// CRC-16/CCITT-FALSE (polynomial 0x1021, initial 0xFFFF, not reflected, no final xor): guards the frame
// header of Cyphal/serial, a transfer in several frames of Cyphal/CAN, and a CAN record. Over data followed
// by its CRC, high byte first, it is 0. crc16_update() carries it from piece to piece, from kCrc16Initial.
// Any context.
inline constexpr std::uint16_t kCrc16Initial = 0xFFFFu;
std::uint16_t crc16_update(std::uint16_t from, std::span<const std::uint8_t> bytes);
std::uint16_t crc16(std::span<const std::uint8_t> bytes);

// CRC-32C, Castagnoli (polynomial 0x1EDC6F41 reflected, initial and final xor 0xFFFFFFFF): guards the
// payload. `state` starts at kCrc32cInitial and is carried from piece to piece; crc32c_value() of it is the
// CRC so far. After data and their CRC, low byte first, the state is kCrc32cResidue whatever the data: a
// receiver need not know where the payload ends. One table look-up a byte; table of 1 KiB. Any context.
inline constexpr std::uint32_t kCrc32cInitial = 0xFFFFFFFFu;
inline constexpr std::uint32_t kCrc32cResidue = 0xB798B438u;
std::uint32_t crc32c_update(std::uint32_t state, std::span<const std::uint8_t> bytes);
constexpr std::uint32_t crc32c_value(std::uint32_t state) {
  return ~state;
}

}  // namespace palpate::wire
