#include "host/link/usb_bus.hpp"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes counting(std::size_t count) {
  Bytes bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(i % 251);
  return bytes;
}

// Table 5-9 of the specification: 19 transactions of 64 bytes a frame, 1,216,000 bytes a second. A second.
TEST(MeteredUsbBus, CarriesNineteenFullPacketsAFrame) {
  MeteredUsbBus bus;
  constexpr std::uint32_t kStart = 3, kTicks = 1000;
  ASSERT_TRUE(bus.down().submit(counting(1'000'000), kStart));
  std::size_t arrived = 0;
  for (std::uint32_t tick = kStart; tick <= kStart + kTicks; ++tick) {
    arrived += bus.down().deliver(tick).size();
    ASSERT_EQ(arrived, std::min<std::size_t>(1'000'000, 1216u * (tick - kStart))) << tick;
    ASSERT_EQ(bus.down().backlog_bytes(tick), 1'000'000 - arrived);
  }
  EXPECT_EQ(bus.down().bytes_per_tick(), 1216.0);
}

// The table's row for 64 bytes: 37 bytes of a frame are left; they stay unused.
TEST(MeteredUsbBus, IsBusyForDataAndOverhead) {
  MeteredUsbBus bus;
  ASSERT_TRUE(bus.up().submit(counting(1000), 0));
  EXPECT_EQ(bus.up().deliver(1), counting(1000));
  // 15 full packets, one of 40 bytes.
  EXPECT_DOUBLE_EQ(bus.up().counters().busy_ticks, (1000.0 + 16 * 13) / 1500);
  EXPECT_EQ(bus.up().counters().bytes_delivered, 1000u);
}

// A transfer that fills its last packet ends with an empty one, which delays what comes behind it.
TEST(MeteredUsbBus, AFullLastPacketIsFollowedByAnEmptyOne) {
  MeteredUsbBus bus;
  for (int i = 0; i < 19; ++i) ASSERT_TRUE(bus.down().submit(counting(64), 0));
  // 64 + 13 + 13 bytes each: 16 of them in 1,500 - 5.
  EXPECT_EQ(bus.down().deliver(1).size(), 16u * 64);
  EXPECT_EQ(bus.down().deliver(2).size(), 3u * 64);
}

// Both directions share the bus: while both have something each gets half of the packets.
TEST(MeteredUsbBus, DirectionsTakeTurns) {
  MeteredUsbBus bus;
  ASSERT_TRUE(bus.down().submit(counting(20'000), 0));
  ASSERT_TRUE(bus.up().submit(counting(20'000), 0));
  for (std::uint32_t tick = 1; tick <= 10; ++tick) {
    const std::size_t down = bus.down().deliver(tick).size(), up = bus.up().deliver(tick).size();
    EXPECT_EQ(down + up, 1216u);
    EXPECT_EQ(std::max(down, up), 640u);
  }
  EXPECT_NEAR(bus.down().counters().busy_ticks + bus.up().counters().busy_ticks, 10.0 * 1463 / 1500, 1e-12);
}

// Whatever is handed over comes out, in order, never before it can have crossed: at least n + 13 for each
// packet of 12 Mbit/s, so never more in a frame than 19 full packets and what is left beside a 20th overhead.
TEST(MeteredUsbBus, NothingIsLostAndNothingIsEarly) {
  constexpr std::size_t kMostBytesAFrame =
      kUsbFrameBytes - kUsbStartOfFrameBytes - 20 * kUsbTransactionOverheadBytes;
  std::mt19937 random(5);
  MeteredUsbBus bus;
  Bytes sent, got;
  for (std::uint32_t tick = 0; tick < 5000; ++tick) {
    const Bytes arrived = bus.up().deliver(tick);
    EXPECT_LE(arrived.size(), kMostBytesAFrame);
    got.insert(got.end(), arrived.begin(), arrived.end());
    ASSERT_EQ(got.size() + bus.up().backlog_bytes(tick), sent.size());
    if (random() % 3 != 0) continue;
    const Bytes bytes = counting(random() % 2000);
    ASSERT_TRUE(bus.up().submit(bytes, tick));
    sent.insert(sent.end(), bytes.begin(), bytes.end());
  }
  EXPECT_GT(got.size(), 1'000'000u);
  EXPECT_TRUE(std::equal(got.begin(), got.end(), sent.begin()));
}

// Looking ahead changes nothing.
TEST(MeteredUsbBus, TellsWhatWillBeLeft) {
  MeteredUsbBus bus;
  ASSERT_TRUE(bus.down().submit(counting(3000), 7));
  EXPECT_EQ(bus.down().backlog_bytes(7), 3000u);
  EXPECT_EQ(bus.down().backlog_bytes(9), 3000u - 2 * 1216);
  EXPECT_EQ(bus.down().deliver(8).size(), 1216u);
}

TEST(MeteredUsbBus, ASubmissionWithoutRoomIsDroppedWhole) {
  MeteredUsbBus bus(1000);
  EXPECT_TRUE(bus.down().submit(counting(900), 0));
  EXPECT_FALSE(bus.down().submit(counting(101), 0));
  EXPECT_TRUE(bus.up().submit(counting(1000), 0));
  EXPECT_EQ(bus.down().counters().bytes_dropped, 101u);
  EXPECT_EQ(bus.down().counters().submissions_dropped, 1u);
  EXPECT_EQ(bus.up().counters().submissions_dropped, 0u);
}

TEST(MeteredUsbBus, RefusesNonsense) {
  EXPECT_THROW(MeteredUsbBus(0), std::invalid_argument);
  MeteredUsbBus bus;
  (void)bus.down().deliver(5);
  EXPECT_THROW((void)bus.up().submit(counting(1), 4), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::link
