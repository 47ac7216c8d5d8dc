#include "firmware/core/motor_heat.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace palpate::firmware {
namespace {

constexpr std::array<float, 3> kNone_A{};
// Of ratios and means of a few numbers.
constexpr float kRounding = 1e-4f;

// A motor that is driven as far as it may.
struct Motors {
  Limits limits{};
  MotorHeat heat = heat_at_start(limits);

  std::array<float, 3> setpoint_A{};

  void tick(const std::array<float, 3>& wanted_A, std::uint32_t elapsed_ticks = 1) {
    setpoint_A = limit_currents(wanted_A, bearable_currents_A(heat, limits)).setpoint_A;
    warm(heat, setpoint_A, setpoint_A, elapsed_ticks, limits);
  }
  [[nodiscard]] float hottest() const { return firmware::hottest(heat, limits); }
};

// Both lags' differential equations, solved.
double exact_heat(const Limits& limits, double ratio, double time_s) {
  const double winding_s = static_cast<double>(limits.winding_s);
  const double housing_s = static_cast<double>(limits.housing_s);
  const double share = static_cast<double>(limits.winding_share);
  const double winding = 1.0 - std::exp(-time_s / winding_s);
  const double housing =
      1.0 - (housing_s * std::exp(-time_s / housing_s) - winding_s * std::exp(-time_s / winding_s)) /
                (housing_s - winding_s);
  return ratio * ratio * (share * winding + (1.0 - share) * housing);
}

TEST(MotorHeat, FollowsTwoBodiesThatWarmEachOther) {
  for (const float current_A : {1.24f, 2.0f, 5.0f}) {
    const Limits limits;
    MotorHeat heat;
    for (int tick = 1; tick <= 400'000; ++tick) {
      warm(heat, {current_A, 0.0f, 0.0f}, kNone_A, 1, limits);
      if (tick != 1000 && tick != 10'000 && tick != 400'000) continue;
      const double expected =
          exact_heat(limits, static_cast<double>(current_A / limits.motor_continuous_A[0]), tick * 1e-3);
      // The housing learns 64 ticks late, which shows in the first second, and steps are of first order.
      EXPECT_NEAR(heat_of(heat, 0, limits), expected, 5e-3 * expected) << current_A << ' ' << tick;
    }
    EXPECT_EQ(heat_of(heat, 1, limits), 0.0f);
    EXPECT_EQ(hottest(heat, limits), heat_of(heat, 0, limits));
  }
}

TEST(MotorHeat, StaysAtOneUnderTheContinuousCurrentForEver) {
  const Limits limits;
  MotorHeat heat;
  for (int i = 0; i < 200'000; ++i)  // 3.5 hours
    warm(heat, {0.0f, 0.0f, -1.24f}, {0.0f, 0.0f, 1.24f}, kHousingPeriod_ticks, limits);
  EXPECT_NEAR(hottest(heat, limits), 1.0f, 1e-3f);
  EXPECT_NEAR(bearable_currents_A(heat, limits)[2], 1.24f, 0.03f);
}

// What docs/safety.md promises: 8 N take 6.6 A at the reference pose.
TEST(MotorHeat, ColdMotorsBearEightNewtonForASecondAndAHalf) {
  Motors motors;
  int ticks = 0;
  for (; bearable_currents_A(motors.heat, motors.limits) == motors.limits.motor_current_A; ++ticks)
    motors.tick({0.0f, 6.56f, 0.0f});
  EXPECT_GT(ticks, 1350);
  EXPECT_LT(ticks, 1500);
}

TEST(MotorHeat, FoldsSmoothlyAndNeverReachesTheFault) {
  for (const bool is_pulsed : {false, true}) {
    Motors motors;
    float before_A = 0.0f, hottest = 0.0f;
    for (std::uint32_t tick = 0; tick < 3'000'000; ++tick) {
      // Pulsed: the winding cools in between, which is when the housing could be warmed most.
      const bool is_on = !is_pulsed || tick / 20'000 % 2 == 0;
      motors.tick({0.0f, is_on ? 7.0f : 0.0f, is_on ? 3.0f : 0.0f});
      hottest = std::max(hottest, motors.hottest());
      if (is_on && before_A > 0.0f) {
        // Of 8.5 N that is 0.09 N, of the 0.5 that no change may be more than.
        ASSERT_LT(std::fabs(motors.setpoint_A[1] - before_A), 0.01f * before_A) << tick;
        ASSERT_NEAR(motors.setpoint_A[2] / motors.setpoint_A[1], 3.0f / 7.0f, kRounding);
      }
      before_A = is_on ? motors.setpoint_A[1] : 0.0f;
    }
    EXPECT_GT(hottest, 0.97f);
    EXPECT_LT(hottest, 1.01f);
    EXPECT_LT(hottest, motors.limits.heat_fault);
    if (!is_pulsed) {
      EXPECT_NEAR(before_A, 1.24f, 0.05f);
    }
  }
}

TEST(MotorHeat, FoldsOnlyTheMotorThatIsHot) {
  const Limits limits{.motor_current_A = {7.0f, 1.0f, 7.0f}};
  const MotorHeat heat{.winding = {3.6f, 8.0f, 3.2f}};
  const auto largest_A = bearable_currents_A(heat, limits);
  EXPECT_NEAR(largest_A[0], 0.5f * (7.0f + 1.24f), kRounding);  // heat 0.9, half way
  EXPECT_EQ(largest_A[1], 1.0f);                                // below the continuous one
  EXPECT_EQ(largest_A[2], 7.0f);
  // Beyond 1 they are the continuous ones still, no less: these never lead there.
  const MotorHeat beyond{.winding = {4.2f, 4.4f, 100.0f}};
  EXPECT_FLOAT_EQ(bearable_currents_A(beyond, limits)[0], 1.24f);
  EXPECT_FLOAT_EQ(bearable_currents_A(beyond, limits)[2], 1.24f);
}

TEST(MotorHeat, StartsWhereTheBoardSaysAndCools) {
  const Limits limits{.heat_at_start = 0.5f};
  MotorHeat heat = heat_at_start(limits);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_FLOAT_EQ(heat_of(heat, i, limits), 0.5f);
  for (int i = 0; i < 450'000; ++i) warm(heat, kNone_A, kNone_A, 1, limits);
  // Windings have cooled down to their housings, a seventy-fifth above them.
  EXPECT_NEAR(hottest(heat, limits), 0.375f * std::exp(-0.5f), 5e-3f);
}

// With heat_at_start 1 a board whose power was lost at the worst moment takes no motor for cooler than it is.
TEST(MotorHeat, AfterALossOfPowerNoMotorIsHotterThanItsAccount) {
  const Limits limits{.heat_at_start = 1.0f};
  // Folded currents lead 1 % beyond 1 (above).
  constexpr float kBeyond = 0.01f;
  Motors driven;  // from cold: hot windings in cold housings, later in warm ones
  for (int second = 0; second < 120; ++second) {
    for (int tick = 0; tick < 1000; ++tick) driven.tick({7.0f, second % 9 < 5 ? 7.0f : 0.0f, 2.0f});
    MotorHeat is = driven.heat, account = heat_at_start(limits);
    for (int tick = 0; tick < 100; ++tick) {
      for (std::size_t i = 0; i < 3; ++i)
        ASSERT_LE(heat_of(is, i, limits), heat_of(account, i, limits) + kBeyond) << second << ' ' << tick;
      const std::array<float, 3> same_A{tick % 2 == 0 ? 7.0f : 0.0f, 0.0f, 1.0f};
      warm(is, same_A, same_A, 50, limits);
      warm(account, same_A, same_A, 50, limits);
    }
  }
}

TEST(MotorHeat, TheLargerOfWantedAndMeasuredCounts) {
  const Limits limits;
  const auto after_a_tick = [&](float setpoint_A, float measured_A) {
    MotorHeat heat;
    warm(heat, {setpoint_A, 0.0f, 0.0f}, {measured_A, 0.0f, 0.0f}, 1, limits);
    return heat.winding[0];
  };
  EXPECT_EQ(after_a_tick(-2.0f, 1.0f), after_a_tick(0.0f, 2.0f));
  EXPECT_EQ(after_a_tick(1.0f, -2.0f), after_a_tick(2.0f, 0.0f));
  // What the monitors cannot mean, or do not say, counts as what over_current lets be.
  const float most = after_a_tick(0.0f, 10.5f);
  EXPECT_EQ(after_a_tick(0.0f, 1e9f), most);
  EXPECT_EQ(after_a_tick(0.0f, std::numeric_limits<float>::quiet_NaN()), most);
  EXPECT_EQ(after_a_tick(0.0f, std::numeric_limits<float>::infinity()), most);
  EXPECT_GT(after_a_tick(0.0f, 10.6f), 0.999f * most);
  EXPECT_LT(after_a_tick(0.0f, 10.4f), most);
}

TEST(MotorHeat, LostTicksCountAndNothingOvershoots) {
  const Limits limits;
  const std::array<float, 3> current_A{2.0f, 2.0f, 2.0f};
  MotorHeat single, lost;
  for (int i = 0; i < 640; ++i) warm(single, current_A, kNone_A, 1, limits);
  for (int i = 0; i < 64; ++i) warm(lost, current_A, kNone_A, 10, limits);
  EXPECT_NEAR(hottest(lost, limits), hottest(single, limits), 0.01f * hottest(single, limits));
  EXPECT_GT(lost.housing[0], 0.0f);
  warm(lost, current_A, kNone_A, 0xffff'0000u, limits);
  EXPECT_FLOAT_EQ(hottest(lost, limits), (2.0f / 1.24f) * (2.0f / 1.24f));
}

// Rounding would hold a housing back that was told of each tick.
TEST(MotorHeat, TheHousingIsToldOfManyTicksAtOnce) {
  const Limits limits;
  MotorHeat heat;
  for (std::uint32_t i = 1; i < kHousingPeriod_ticks; ++i) warm(heat, {2.0f, 0.0f, 0.0f}, kNone_A, 1, limits);
  EXPECT_EQ(heat.housing[0], 0.0f);
  EXPECT_EQ(heat.pending_ticks, kHousingPeriod_ticks - 1);
  warm(heat, {2.0f, 0.0f, 0.0f}, kNone_A, 1, limits);
  EXPECT_FLOAT_EQ(heat.housing[0], heat.winding[0] * 0.064f / 900.0f);
  EXPECT_EQ(heat.pending_ticks, 0u);
}

}  // namespace
}  // namespace palpate::firmware
