#include "shared/wire/frame.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes encode(const FrameHeader& header, const Bytes& payload) {
  Bytes out(max_frame_bytes(payload.size()));
  out.resize(encode_frame(header, payload, out));
  return out;
}

// Bytes that pycyphal 1.27.0 (SerialFrame, serialize_transfer) made of the same transfers.
TEST(Frame, MessageEqualsPycyphal) {
  const FrameHeader header{.priority = Priority::high,
                           .source = kBoardNode,
                           .destination = kBroadcast,
                           .specifier = message_specifier(kServoTraceSubject),
                           .transfer_id = 0x0102030405060708u};
  EXPECT_EQ(encode(header, {0x00, 0x01, 0x02, 0x00, 0xFF}),
            (Bytes{0x00, 0x04, 0x01, 0x03, 0x2A, 0x0D, 0xFF, 0xFF, 0x40, 0x06, 0x08, 0x07,
                   0x06, 0x05, 0x04, 0x03, 0x02, 0x01, 0x01, 0x01, 0x02, 0x80, 0x01, 0x03,
                   0xAC, 0x79, 0x03, 0x01, 0x02, 0x06, 0xFF, 0xD1, 0xDD, 0x25, 0x7A, 0x00}));
}

TEST(Frame, RequestEqualsPycyphal) {
  const FrameHeader header{.priority = Priority::nominal,
                           .source = kHostNode,
                           .destination = kBoardNode,
                           .specifier = request_specifier(kCommandService),
                           .transfer_id = 7};
  EXPECT_EQ(encode(header, {0x02, 0x00, 0x00, 0x00, 0x78, 0x56, 0x34, 0x12}),
            (Bytes{0x00, 0x04, 0x01, 0x04, 0x0A, 0x02, 0x2A, 0x04, 0x2C, 0xC1, 0x07, 0x01, 0x01,
                   0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x02, 0x80, 0x01, 0x04, 0xFB, 0x03,
                   0x02, 0x01, 0x01, 0x09, 0x78, 0x56, 0x34, 0x12, 0xF0, 0x1E, 0x24, 0xE4, 0x00}));
}

TEST(Frame, EmptyResponseEqualsPycyphal) {
  const FrameHeader header{.priority = Priority::nominal,
                           .source = kBoardNode,
                           .destination = kHostNode,
                           .specifier = response_specifier(kGetInfoService),
                           .transfer_id = 0};
  EXPECT_EQ(encode(header, {}), (Bytes{0x00, 0x04, 0x01, 0x04, 0x2A, 0x02, 0x0A, 0x03, 0x2D, 0x81, 0x01,
                                       0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x02, 0x80,
                                       0x01, 0x03, 0x2A, 0x51, 0x01, 0x01, 0x01, 0x01, 0x00}));
}

TEST(Frame, HeaderRoundTrip) {
  const FrameHeader header{.priority = Priority::optional,
                           .source = 0x1234,
                           .destination = 0xFFFE,
                           .specifier = 0xC12C,
                           .transfer_id = 0xFFFFFFFFFFFFFFFFu};
  std::array<std::uint8_t, kHeaderBytes> bytes{};
  write_header(header, bytes);
  FrameHeader back;
  ASSERT_EQ(parse_header(bytes, back), Status::ok);
  EXPECT_EQ(back, header);
}

TEST(Frame, EveryBitOfTheHeaderIsGuarded) {
  std::array<std::uint8_t, kHeaderBytes> bytes{};
  write_header({.source = 42, .specifier = 1600, .transfer_id = 99}, bytes);
  for (std::size_t bit = 0; bit < 8 * kHeaderBytes; ++bit) {
    std::array<std::uint8_t, kHeaderBytes> flipped = bytes;
    flipped[bit / 8] = static_cast<std::uint8_t>(flipped[bit / 8] ^ (1u << (bit % 8)));
    FrameHeader header;
    EXPECT_EQ(parse_header(flipped, header), Status::header_crc_mismatch) << bit;
  }
}

// A header with a field changed and its CRC made right again.
Status parse_with(std::size_t at, std::uint8_t value) {
  std::array<std::uint8_t, kHeaderBytes> bytes{};
  write_header({.source = 42, .specifier = 1600}, bytes);
  bytes[at] = value;
  const std::uint16_t crc = crc16(std::span(bytes).first<kHeaderBytes - 2>());
  bytes[kHeaderBytes - 2] = static_cast<std::uint8_t>(crc >> 8);
  bytes[kHeaderBytes - 1] = static_cast<std::uint8_t>(crc & 0xFF);
  FrameHeader header;
  return parse_header(bytes, header);
}

TEST(Frame, HeadersThatAreNotForThisLink) {
  EXPECT_EQ(parse_with(0, 0), Status::header_version_unknown);
  EXPECT_EQ(parse_with(0, 2), Status::header_version_unknown);
  EXPECT_EQ(parse_with(1, 7), Status::ok);
  EXPECT_EQ(parse_with(1, 8), Status::header_version_unknown);
  EXPECT_EQ(parse_with(16, 1), Status::not_a_single_frame);  // second frame of a transfer
  EXPECT_EQ(parse_with(19, 0), Status::not_a_single_frame);  // more frames follow
  EXPECT_EQ(parse_with(20, 1), Status::ok);                  // user data are ignored
}

TEST(Frame, EncoderReportsTooSmallSpan) {
  for (const Bytes& payload : {Bytes{}, Bytes{0, 0, 0}, Bytes(226, 9), Bytes(500, 1)}) {
    const Bytes frame = encode({}, payload);
    ASSERT_LE(frame.size(), max_frame_bytes(payload.size()));
    Bytes out(frame.size(), 0xEE);
    for (std::size_t room = 0; room < frame.size(); ++room)
      EXPECT_EQ(encode_frame({}, payload, std::span(out).first(room)), 0u) << room;
    EXPECT_EQ(out.back(), 0xEE);
    EXPECT_EQ(encode_frame({}, payload, out), frame.size());
    EXPECT_EQ(out, frame);
  }
}

}  // namespace
}  // namespace palpate::wire
