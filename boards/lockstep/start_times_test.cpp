#include "boards/lockstep/start_times.hpp"

#include <gtest/gtest.h>

namespace palpate::board {
namespace {

using firmware::Limits;

TEST(StartTimes, AreTakenInTheirOrder) {
  Limits limits;
  ASSERT_TRUE(take_start_times("times=50:20:300:1000", limits));
  EXPECT_EQ(limits.model_horizon_ticks, 50u);
  EXPECT_EQ(limits.model_fade_ticks, 20u);
  EXPECT_EQ(limits.damping_ticks, 300u);
  EXPECT_EQ(limits.link_lost_ticks, 1000u);
}

TEST(StartTimes, AnEmptyFieldLeavesTheBoardsOwn) {
  Limits limits{.model_horizon_ticks = 70, .damping_ticks = 80};
  ASSERT_TRUE(take_start_times("times=:30::", limits));
  EXPECT_EQ(limits.model_horizon_ticks, 70u);
  EXPECT_EQ(limits.model_fade_ticks, 30u);
  EXPECT_EQ(limits.damping_ticks, 80u);
  EXPECT_EQ(limits.link_lost_ticks, Limits{}.link_lost_ticks);
}

TEST(StartTimes, WhatIsNoneIsRefused) {
  for (const char* argument :
       {"", "uart", "times", "times=", "times=1:2:3", "times=50:20:300:1000:", "times=50:20:300:1000 ",
        "times=a:::", "times=-1:::", "times= 1:::", "times=0:::", "times=5001:::", "times=:19::",
        "times=::5001:", "times=:::999", "times=4294967396:::", "times=:::60001", "times=:::::",
        // Lost before outputs are off, with the board's own 200 ticks of fading and 1,000 of damping.
        "times=1000:::2199"}) {
    Limits limits;
    EXPECT_FALSE(take_start_times(argument, limits)) << argument;
  }
}

}  // namespace
}  // namespace palpate::board
