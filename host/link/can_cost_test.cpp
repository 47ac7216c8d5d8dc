#include "host/link/can_cost.hpp"

#include <gtest/gtest.h>

namespace palpate::link {
namespace {

// By hand: a classic frame of 8 bytes has 39 + 64 + 15 stuffable bits, with at most 29 stuff bits, and 13
// more.
TEST(CanCost, ClassicFramesAndTransfers) {
  const CanBus bus = kClassicCan_1_Mbit;
  EXPECT_NEAR(can_frame_s(bus, 8), 160e-6, 1e-12);
  EXPECT_NEAR(can_frame_s(bus, 1), 90e-6, 1e-12);
  EXPECT_EQ(can_frames(bus, 0), 1u);
  EXPECT_EQ(can_frames(bus, 7), 1u);
  EXPECT_EQ(can_frames(bus, 8), 2u);  // 8 and a CRC of 2
  EXPECT_EQ(can_frames(bus, 12), 2u);
  EXPECT_EQ(can_frames(bus, 13), 3u);
  EXPECT_NEAR(can_transfer_s(bus, 12), 320e-6, 1e-12);
}

// By hand: 36 + 8 stuff bits and 13 at 1 us; 5 + 512 with 129 stuff bits, 1, 4, 21 and 7 at 0.2 us.
TEST(CanCost, FramesOfCanFd) {
  const CanBus bus = kCanFd_5_Mbit;
  EXPECT_NEAR(can_frame_s(bus, 64), 57e-6 + 679 * 0.2e-6, 1e-12);
  EXPECT_EQ(can_frames(bus, 63), 1u);
  EXPECT_EQ(can_frames(bus, 64), 2u);
  EXPECT_EQ(can_frames(bus, 124), 2u);
  EXPECT_EQ(can_frames(bus, 125), 3u);
}

}  // namespace
}  // namespace palpate::link
