#include "host/session/tip_history.hpp"

#include <gtest/gtest.h>

namespace palpate::host {
namespace {

Vec3d tip(double x_m) {
  return {x_m, 2.0 * x_m, -x_m};
}

TEST(TipHistory, InOrder) {
  TipHistory history;
  EXPECT_TRUE(history.empty());
  for (std::uint32_t tick = 100; tick < 110; ++tick) history.add(tick, tip(tick));
  EXPECT_FALSE(history.empty());
  EXPECT_EQ(history.first_tick(), 100u);
  EXPECT_EQ(history.complete_tick(), 109u);
  EXPECT_TRUE(history.gaps().empty());
  EXPECT_EQ(history.at(104), tip(104));
}

TEST(TipHistory, LateSamplesFillTheirGap) {
  TipHistory history;
  for (const std::uint32_t tick : {100u, 101u, 104u, 107u}) history.add(tick, tip(tick));
  EXPECT_EQ(history.complete_tick(), 101u);
  auto gaps = history.gaps();
  ASSERT_EQ(gaps.size(), 2u);
  EXPECT_EQ(gaps[0].first, 102u);
  EXPECT_EQ(gaps[0].count, 2u);
  EXPECT_EQ(gaps[1].first, 105u);
  EXPECT_EQ(gaps[1].count, 2u);
  history.add(103, tip(103));
  history.add(102, tip(102));
  EXPECT_EQ(history.complete_tick(), 104u);
  gaps = history.gaps();
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_EQ(gaps[0].first, 105u);
}

TEST(TipHistory, TheFirstWordCounts) {
  TipHistory history;
  history.add(5, tip(5));
  history.add(5, tip(50));
  history.add(4, tip(4));  // before the first one seen
  EXPECT_EQ(history.first_tick(), 5u);
  EXPECT_EQ(history.at(5), tip(5));
}

TEST(TipHistory, InterpolatesOnlyGapsThatEndInTime) {
  TipHistory history;
  for (const std::uint32_t tick : {10u, 14u, 16u}) history.add(tick, tip(tick));
  EXPECT_TRUE(history.interpolate_until(12).empty());  // the gap ends at 13
  EXPECT_EQ(history.interpolate_until(13), (std::vector<std::uint32_t>{11, 12, 13}));
  for (std::uint32_t tick = 10; tick <= 14; ++tick) EXPECT_LE(norm(history.at(tick) - tip(tick)), 1e-12);
  EXPECT_EQ(history.complete_tick(), 14u);
  EXPECT_EQ(history.interpolate_until(100), (std::vector<std::uint32_t>{15}));
  EXPECT_EQ(history.complete_tick(), 16u);
  history.add(12, tip(120));  // too late
  EXPECT_LE(norm(history.at(12) - tip(12)), 1e-12);
}

TEST(TipHistory, Forgets) {
  TipHistory history;
  for (std::uint32_t tick = 10; tick < 20; ++tick) history.add(tick, tip(tick));
  history.forget_before(15);
  EXPECT_EQ(history.first_tick(), 15u);
  EXPECT_EQ(history.complete_tick(), 19u);
  EXPECT_EQ(history.at(15), tip(15));
  history.add(14, tip(14));  // consumed
  EXPECT_EQ(history.first_tick(), 15u);
  history.forget_before(12);  // nothing to forget
  EXPECT_EQ(history.first_tick(), 15u);
  EXPECT_EQ(history.complete_tick(), 19u);
  history.forget_before(30);  // the newest stays
  EXPECT_EQ(history.first_tick(), 19u);
  EXPECT_EQ(history.at(19), tip(19));
}

TEST(TipHistory, TicksWrapAround) {
  TipHistory history;
  history.add(0xfffffffeu, tip(1));
  history.add(1, tip(4));
  EXPECT_EQ(history.complete_tick(), 0xfffffffeu);
  EXPECT_EQ(history.interpolate_until(0), (std::vector<std::uint32_t>{0xffffffffu, 0u}));
  EXPECT_LE(norm(history.at(0) - tip(3)), 1e-12);
  history.forget_before(0);
  EXPECT_EQ(history.first_tick(), 0u);
  EXPECT_EQ(history.complete_tick(), 1u);
}

TEST(TipHistory, KnowsTicksOfAnotherPath) {
  TipHistory history;
  EXPECT_TRUE(history.follows(7));
  history.add(50'000, tip(1));
  EXPECT_TRUE(history.follows(50'000 - kOldest_ticks));  // said again
  EXPECT_FALSE(history.follows(50'000 - kOldest_ticks - 1));
  EXPECT_FALSE(history.follows(0));
  EXPECT_TRUE(history.follows(50'000 + kLongestHistory_ticks - 1));
  EXPECT_FALSE(history.follows(50'000 + kLongestHistory_ticks));
}

}  // namespace
}  // namespace palpate::host
