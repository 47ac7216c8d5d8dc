#include "shared/wire/can_sender.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes counting(std::size_t length) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

// Data of all frames of a transfer.
std::vector<Bytes> frames(const FrameHeader& header, const Bytes& payload, CanFormat format) {
  CanSender sender;
  EXPECT_EQ(sender.begin(header, payload, format), Status::ok);
  std::vector<Bytes> all;
  while (!sender.done()) {
    const CanFrame frame = sender.next();
    EXPECT_EQ(frame.fd, format == CanFormat::fd);
    all.emplace_back(frame.data.begin(), frame.data.end());
  }
  return all;
}

FrameHeader message(std::uint64_t transfer_id) {
  return {
      .source = kHostNode, .specifier = message_specifier(kModelStateSubject), .transfer_id = transfer_id};
}

// Frames that pycyphal 1.27.0 (serialize_transfer) made of the same transfers.
TEST(CanSender, FramesEqualPycyphals) {
  EXPECT_EQ(frames(message(0), {1, 2, 3}, CanFormat::classic), (std::vector<Bytes>{{1, 2, 3, 0xE0}}));
  EXPECT_EQ(frames(message(37), counting(20), CanFormat::classic),
            (std::vector<Bytes>{{0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xA5},
                                {0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x05},
                                {0x0E, 0x0F, 0x10, 0x11, 0x12, 0x13, 0x5A, 0x25},  // the CRC is cut
                                {0x74, 0x45}}));
  const FrameHeader request{
      .source = kHostNode, .destination = kBoardNode, .specifier = request_specifier(300), .transfer_id = 7};
  EXPECT_EQ(frames(request, {0x02, 0x00, 0x00, 0x00, 0x78, 0x56, 0x34, 0x12}, CanFormat::classic),
            (std::vector<Bytes>{{0x02, 0x00, 0x00, 0x00, 0x78, 0x56, 0x34, 0xA7}, {0x12, 0x6E, 0x62, 0x47}}));
  EXPECT_EQ(frames(message(31), counting(9), CanFormat::fd),  // padded
            (std::vector<Bytes>{{0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x00, 0x00, 0xFF}}));
  Bytes first = counting(63);
  first.push_back(0xA5);
  EXPECT_EQ(
      frames(message(5), counting(70), CanFormat::fd),
      (std::vector<Bytes>{first, {0x3F, 0x40, 0x41, 0x42, 0x43, 0x44, 0x45, 0x00, 0x00, 0x20, 0x71, 0x45}}));
}

TEST(CanSender, EmptyPayloadIsOneFrame) {
  for (const CanFormat format : {CanFormat::classic, CanFormat::fd})
    EXPECT_EQ(frames(message(3), {}, format), (std::vector<Bytes>{{0xE3}}));
}

// Every length of data is one that frames can have, only the last frame is not full, and the sizes are those
// that were foretold.
TEST(CanSender, LengthsOfEveryPayload) {
  for (const CanFormat format : {CanFormat::classic, CanFormat::fd})
    for (std::size_t length = 0; length <= 700; ++length) {
      const std::vector<Bytes> all = frames(message(length), counting(length), format);
      ASSERT_EQ(all.size(), can_transfer_frames(length, format)) << length;
      std::size_t record_bytes = 0, content_bytes = 0;
      for (std::size_t i = 0; i < all.size(); ++i) {
        ASSERT_EQ(can_padded_bytes(all[i].size()), all[i].size());
        ASSERT_TRUE(i + 1 == all.size() || all[i].size() == can_mtu(format));
        record_bytes += all[i].size() + kCanRecordOverheadBytes;
        content_bytes += all[i].size() - kCanTailBytes;
      }
      ASSERT_EQ(record_bytes, can_transfer_bytes(length, format));
      ASSERT_EQ(content_bytes, can_content_bytes(length, format));
      const std::size_t least = length + (all.size() > 1 ? kCanTransferCrcBytes : 0);
      ASSERT_GE(content_bytes, least);
      ASSERT_LE(content_bytes, least + (format == CanFormat::fd ? 15 : 0));
    }
}

// However little room there is at a time, the records are the same.
TEST(CanSender, PiecesGiveTheSameAsTheWhole) {
  for (const CanFormat format : {CanFormat::classic, CanFormat::fd}) {
    const Bytes payload = counting(1448);
    CanSender sender;
    ASSERT_EQ(sender.begin(message(9), payload, format), Status::ok);
    Bytes whole(can_transfer_bytes(payload.size(), format));
    ASSERT_EQ(sender.write(whole), whole.size());
    ASSERT_TRUE(sender.done());
    ASSERT_EQ(sender.write(whole), 0u);
    const std::size_t record = can_mtu(format) + kCanRecordOverheadBytes;
    for (const std::size_t room : {record, record + 1, 3 * record - 1, std::size_t{500}}) {
      ASSERT_EQ(sender.begin(message(9), payload, format), Status::ok);
      Bytes pieces, piece(room);
      while (!sender.done()) {
        const std::size_t written = sender.write(piece);
        ASSERT_GT(written, 0u);
        pieces.insert(pieces.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(written));
      }
      ASSERT_EQ(pieces, whole);
    }
    ASSERT_EQ(sender.begin(message(9), payload, format), Status::ok);
    Bytes too_small(record - 1);
    EXPECT_EQ(sender.write(too_small), 0u);
    EXPECT_FALSE(sender.done());
  }
}

TEST(CanSender, HeaderThatCanCannotName) {
  CanSender sender;
  ASSERT_EQ(sender.begin(message(0), {}, CanFormat::classic), Status::ok);
  EXPECT_EQ(sender.begin({.source = 128, .specifier = 1600}, {}, CanFormat::classic), Status::not_for_can);
  EXPECT_TRUE(sender.done());
}

}  // namespace
}  // namespace palpate::wire
