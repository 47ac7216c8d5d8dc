#include "shared/wire/crc.hpp"

#include <array>
#include <cstddef>

namespace palpate::wire {
namespace {

// Remainders of the 256 byte values, reflected form.
constexpr std::array<std::uint32_t, 256> kCrc32cTable = [] {
  constexpr std::uint32_t kPolynomial = 0x82F63B78u;  // 0x1EDC6F41 with its bits reversed
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t remainder = byte;
    for (int bit = 0; bit < 8; ++bit)
      remainder = (remainder >> 1) ^ ((remainder & 1u) != 0 ? kPolynomial : 0u);
    table[byte] = remainder;
  }
  return table;
}();

// Remainders of the 16 values of four bits: two look-ups a byte, and 32 bytes of table in place of 512.
constexpr std::array<std::uint16_t, 16> kCrc16Table = [] {
  constexpr std::uint32_t kPolynomial = 0x1021u;
  std::array<std::uint16_t, 16> table{};
  for (std::uint32_t nibble = 0; nibble < 16; ++nibble) {
    std::uint32_t remainder = nibble << 12;
    for (int bit = 0; bit < 4; ++bit)
      remainder = (remainder << 1) ^ ((remainder & 0x8000u) != 0 ? kPolynomial : 0u);
    table[nibble] = static_cast<std::uint16_t>(remainder & 0xFFFFu);
  }
  return table;
}();

}  // namespace

std::uint16_t crc16_update(std::uint16_t from, std::span<const std::uint8_t> bytes) {
  std::uint32_t state = from;
  for (const std::uint8_t byte : bytes) {
    state = (state << 4) ^ kCrc16Table[((state >> 12) ^ (byte >> 4)) & 0xFu];
    state = (state << 4) ^ kCrc16Table[((state >> 12) ^ byte) & 0xFu];
  }
  return static_cast<std::uint16_t>(state & 0xFFFFu);
}

std::uint16_t crc16(std::span<const std::uint8_t> bytes) {
  return crc16_update(kCrc16Initial, bytes);
}

std::uint32_t crc32c_update(std::uint32_t state, std::span<const std::uint8_t> bytes) {
  for (const std::uint8_t byte : bytes) state = (state >> 8) ^ kCrc32cTable[(state ^ byte) & 0xFFu];
  return state;
}

}  // namespace palpate::wire
