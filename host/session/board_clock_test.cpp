#include "host/session/board_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace palpate::host {
namespace {

double ticks_off(const BoardClock& clock, double now_s, double true_tick) {
  return static_cast<double>(clock.tick(now_s)) - true_tick;
}

TEST(BoardClock, IsTheHostsBeforeAnythingIsHeard) {
  const BoardClock clock;
  EXPECT_EQ(clock.tick(0.25), 250u);
}

// Messages every 4 ticks, late by 1 to 30 ms, over a minute, by a quartz that is wrong by 1e-4.
TEST(BoardClock, IsLateByTheShortestDelay) {
  for (const double quartz : {-1e-4, 0.0, 1e-4}) {
    BoardClock clock;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> delay_s(0.001, 0.030);
    double arrived_s = 0.0;
    for (double sent_s = 5.0; sent_s < 65.0; sent_s += 0.004) {
      const auto tick = static_cast<std::uint32_t>(sent_s * (1.0 + quartz) * 1000.0);
      arrived_s = std::max(arrived_s, sent_s + delay_s(random));
      EXPECT_FALSE(clock.hear(tick, arrived_s));
      if (sent_s < 6.0) continue;
      const double off = ticks_off(clock, arrived_s, arrived_s * (1.0 + quartz) * 1000.0);
      // Never ahead but by rounding. Behind by a third of the longest delay at most: frames do not overtake
      // each other, so one comes within 10 ms of its tick where it and the five before it were quick, (1/3)^6
      // of 250 a second; what was learnt then fades by a tick in each second that passes.
      EXPECT_LE(off, 0.5);
      EXPECT_GE(off, -10.0);
    }
  }
}

TEST(BoardClock, FollowsABoardThatStartsAgain) {
  BoardClock clock;
  for (int i = 0; i < 1000; ++i) clock.hear(static_cast<std::uint32_t>(30'000 + i), 1.0 + 0.001 * i);
  EXPECT_TRUE(clock.hear(20, 2.5));
  EXPECT_EQ(clock.tick(2.5), 20u);
  EXPECT_FALSE(clock.hear(120, 2.6));
  EXPECT_NEAR(clock.tick(2.7), 220.0, 1.0);
}

TEST(BoardClock, CountsOnWhereTheBoardsCounterWraps) {
  BoardClock clock;
  const std::uint32_t begin = 0xffffff00u;
  for (std::uint32_t i = 0; i < 1000; ++i) clock.hear(begin + i, 0.001 * i);
  EXPECT_NEAR(static_cast<double>(clock.tick(0.999) - begin), 999.0, 1.0);
}

}  // namespace
}  // namespace palpate::host
