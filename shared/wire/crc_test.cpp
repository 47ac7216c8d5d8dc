#include "shared/wire/crc.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <vector>

namespace palpate::wire {
namespace {

// The input for which the catalogue of parametrised CRC algorithms (G. Cook) lists check values.
constexpr std::array<std::uint8_t, 9> kCheckInput{'1', '2', '3', '4', '5', '6', '7', '8', '9'};

TEST(Crc, CatalogueCheckValues) {
  EXPECT_EQ(crc16(kCheckInput), 0x29B1u);
  EXPECT_EQ(crc32c_value(crc32c_update(kCrc32cInitial, kCheckInput)), 0xE3069283u);
}

TEST(Crc, EmptyInput) {
  EXPECT_EQ(crc16({}), 0xFFFFu);
  EXPECT_EQ(crc32c_value(crc32c_update(kCrc32cInitial, {})), 0u);
}

// RFC 3720 (iSCSI), appendix B.4: CRC-32C of 32 bytes of zeros, of ones, and counting up.
TEST(Crc, Crc32cOfRfc3720) {
  const std::vector<std::uint8_t> zeros(32, 0x00), ones(32, 0xFF);
  std::vector<std::uint8_t> counting(32);
  for (std::size_t i = 0; i < counting.size(); ++i) counting[i] = static_cast<std::uint8_t>(i);
  EXPECT_EQ(crc32c_value(crc32c_update(kCrc32cInitial, zeros)), 0x8A9136AAu);
  EXPECT_EQ(crc32c_value(crc32c_update(kCrc32cInitial, ones)), 0x62A8AB43u);
  EXPECT_EQ(crc32c_value(crc32c_update(kCrc32cInitial, counting)), 0x46DD794Eu);
}

TEST(Crc, PiecesGiveTheSameAsTheWhole) {
  const std::uint32_t whole = crc32c_update(kCrc32cInitial, kCheckInput);
  for (std::size_t cut = 0; cut <= kCheckInput.size(); ++cut) {
    const std::span<const std::uint8_t> input(kCheckInput);
    EXPECT_EQ(crc16_update(crc16_update(kCrc16Initial, input.first(cut)), input.subspan(cut)), crc16(input));
    EXPECT_EQ(crc32c_update(crc32c_update(kCrc32cInitial, input.first(cut)), input.subspan(cut)), whole);
  }
}

TEST(Crc, ResidueAfterDataAndTheirCrc) {
  for (std::size_t length = 0; length < 64; ++length) {
    std::vector<std::uint8_t> data(length);
    for (std::size_t i = 0; i < length; ++i) data[i] = static_cast<std::uint8_t>(37 * i + length);

    const std::uint16_t header_crc = crc16(data);
    std::vector<std::uint8_t> with_header_crc = data;
    with_header_crc.push_back(static_cast<std::uint8_t>(header_crc >> 8));
    with_header_crc.push_back(static_cast<std::uint8_t>(header_crc & 0xFF));
    EXPECT_EQ(crc16(with_header_crc), 0u);

    const std::uint32_t payload_crc = crc32c_value(crc32c_update(kCrc32cInitial, data));
    for (int shift = 0; shift < 32; shift += 8)
      data.push_back(static_cast<std::uint8_t>((payload_crc >> shift) & 0xFF));
    EXPECT_EQ(crc32c_update(kCrc32cInitial, data), kCrc32cResidue);
  }
}

}  // namespace
}  // namespace palpate::wire
