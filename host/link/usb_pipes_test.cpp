#include "host/link/usb_pipes.hpp"

#include <gtest/gtest.h>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<std::uint8_t> kinds(const Bytes& records) {
  std::vector<std::uint8_t> found;
  for (std::size_t at = 0; at < records.size(); at += lockstep::kUsbHeaderBytes + records[at + 2])
    found.push_back(records[at]);
  return found;
}

UsbAnswer packet(UsbRecord kind, std::size_t bytes) {
  return {.kind = kind, .address = 0x81, .data = Bytes(bytes, 1)};
}

// Toggles alternate over frames; a packet whose answer is not heard goes again with the one that it had.
TEST(UsbOutPipe, PacketsAlternateTheirToggles) {
  UsbOutPipe pipe;
  pipe.submit(Bytes(64));  // and an empty one
  pipe.submit(Bytes(10));
  Bytes records;
  pipe.append_packet(records, 1, true);
  pipe.append_packet(records, 1, false);
  pipe.append_packet(records, 1, true);
  EXPECT_EQ(pipe.packet_bytes(), 10u);
  pipe.append_packet(records, 1, true);
  EXPECT_FALSE(pipe.has_packet());
  EXPECT_EQ(kinds(records), (std::vector<std::uint8_t>{0x11, 0x12, 0x12, 0x11}));
  EXPECT_EQ(pipe.frames(), 2u);
  EXPECT_EQ(pipe.take(UsbRecord::ack).bytes, 64u);
  EXPECT_EQ(pipe.frames(), 1u);  // its bytes are there, though its end is not
  EXPECT_TRUE(pipe.take(UsbRecord::ack).is_good);
  EXPECT_TRUE(pipe.take(UsbRecord::ack).is_good);
  EXPECT_EQ(pipe.frames(), 0u);
}

// Behind a refused packet all wait until the last one that is on its way is answered; then they begin again
// with the first, marked, and its toggle.
TEST(UsbOutPipe, BeginsAgainWithWhatWasRefused) {
  UsbOutPipe pipe;
  pipe.submit(Bytes(200));
  Bytes records;
  for (int i = 0; i < 3; ++i) pipe.append_packet(records, 1, true);
  EXPECT_TRUE(pipe.take(UsbRecord::ack).is_good);
  EXPECT_TRUE(pipe.take(UsbRecord::nak).is_good);
  EXPECT_FALSE(pipe.has_packet());
  EXPECT_EQ(pipe.waiting_bytes(), 136u);
  EXPECT_TRUE(pipe.take(UsbRecord::nak).is_good);
  ASSERT_TRUE(pipe.has_packet());
  records.clear();
  pipe.append_packet(records, 1, true);
  pipe.append_packet(records, 1, true);
  EXPECT_EQ(kinds(records), (std::vector<std::uint8_t>{0x12, 0x11}));
  EXPECT_EQ(records[1], 1 | lockstep::kUsbAgain);
  EXPECT_EQ(records[lockstep::kUsbRecordBytes + 1], 1);
}

// A device that takes what is behind a refused packet, or answers what was not sent, is found.
TEST(UsbOutPipe, TellsAnswersThatCannotBe) {
  UsbOutPipe pipe;
  pipe.submit(Bytes(200));
  Bytes records;
  for (int i = 0; i < 3; ++i) pipe.append_packet(records, 1, true);
  EXPECT_TRUE(pipe.take(UsbRecord::nak).is_good);
  EXPECT_FALSE(pipe.take(UsbRecord::ack).is_good);
  EXPECT_FALSE(pipe.take(UsbRecord::data0).is_good);
  EXPECT_FALSE(pipe.take(UsbRecord::ack).is_good);
}

TEST(UsbInPipe, APacketWithTheToggleOfTheOneBeforeIsACopy) {
  UsbInPipe pipe;
  EXPECT_FALSE(pipe.take(packet(UsbRecord::data0, 64)).is_copy);
  EXPECT_TRUE(pipe.take(packet(UsbRecord::data0, 64)).is_copy);
  EXPECT_TRUE(pipe.completed().empty());
  const UsbInPipe::Taken last = pipe.take(packet(UsbRecord::data1, 3));
  EXPECT_TRUE(!last.is_copy && last.ends_transfer);
  EXPECT_EQ(pipe.completed().size(), 67u);
}

// The host's buffer ends a transfer, too.
TEST(UsbInPipe, AFullBufferEndsATransfer) {
  UsbInPipe pipe;
  std::size_t packets = 0;
  while (!pipe.take(packet(packets % 2 == 0 ? UsbRecord::data0 : UsbRecord::data1, 64)).ends_transfer)
    ASSERT_LT(++packets, 1000u);
  EXPECT_EQ(pipe.completed().size(), UsbInPipe::kTransferBytes);
}

}  // namespace
}  // namespace palpate::link
