#include "firmware/core/limit_ranges.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace palpate::firmware {
namespace {

static_assert(bad_limit(kDefaultLimits).empty());

TEST(LimitRanges, EachEndIsAllowedAndWhatLiesBeyondIsNamed) {
  // Where one limit bounds another, both move together; so each is tried by its own name alone.
  for (const auto& range : kTickRanges) {
    Limits limits;
    limits.*range.limit = range.most + 1;
    EXPECT_EQ(bad_limit(limits), range.name);
    limits.*range.limit = range.most;
    EXPECT_NE(bad_limit(limits), range.name);
    if (range.least == 0) continue;
    limits.*range.limit = range.least - 1;
    EXPECT_EQ(bad_limit(limits), range.name);
  }
  for (const auto& range : kNumberRanges) {
    Limits limits;
    for (const float value :
         {std::nextafter(range.most, 1e9f), std::nextafter(range.least, -1.0f), -1.0f,
          std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
      limits.*range.limit = value;
      EXPECT_EQ(bad_limit(limits), range.name) << value;
    }
  }
}

TEST(LimitRanges, LimitsMustGoTogether) {
  EXPECT_EQ(bad_limit({.peak_force_N = 30.0f, .force_fault_N = 20.0f}), "force_fault_N");
  EXPECT_EQ(bad_limit({.peak_force_N = 3.0f}), "direct_force_N");  // whose default is 5
  EXPECT_EQ(bad_limit({.direct_hold_ticks = 100, .direct_fade_ticks = 150, .direct_lost_ticks = 200}),
            "direct_lost_ticks");
  EXPECT_EQ(bad_limit({.missed_deadline_weight = 20, .missed_deadline_bucket = 201}),
            "missed_deadline_bucket");
  EXPECT_EQ(bad_limit({.missed_deadline_weight = 20, .missed_deadline_bucket = 200}), "");
  EXPECT_EQ(bad_limit({.model_horizon_ticks = 5000, .link_lost_ticks = 1000}), "link_lost_ticks");
  EXPECT_EQ(bad_limit({.damping_ticks = 1000, .link_lost_ticks = 2199}), "link_lost_ticks");
  EXPECT_EQ(bad_limit({.damping_ticks = 1000, .link_lost_ticks = 2200}), "");
  EXPECT_EQ(bad_limit({.model_horizon_ticks = 1,
                       .model_fade_ticks = 20,
                       .link_silent_ticks = 500,
                       .damping_ticks = 501,
                       .link_lost_ticks = 1000}),
            "link_lost_ticks");
  EXPECT_EQ(bad_limit({.calibration_motion_count = -1}), "calibration_motion_count");
  EXPECT_EQ(bad_limit({.calibration_motion_count = 11}), "calibration_motion_count");
  EXPECT_EQ(bad_limit({.calibration_motion_count = 10}), "");
  EXPECT_EQ(bad_limit({.calibration_motion_count = 0}), "");
  EXPECT_EQ(bad_limit({.motor_current_A = {1.0f, 0.0f, 1.0f}}), "motor_current_A");
  EXPECT_EQ(bad_limit({.motor_current_A = {1.0f, 1.0f, 50.5f}}), "motor_current_A");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {0.0f, 1.0f, 1.0f}}), "motor_continuous_A");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {1.3f, 1.3f, NAN}}), "motor_continuous_A");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {1.3f, 1.3f, 50.5f}}), "motor_continuous_A");
  // Ends that are allowed.
  EXPECT_EQ(bad_limit({.motor_current_A = {0.5f, 0.5f, 0.5f}}), "");
  EXPECT_NE(bad_limit({.motor_current_A = {50.0f, 50.0f, 50.0f}}), "motor_current_A");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {50.0f, 50.0f, 50.0f}}), "");
  EXPECT_EQ(bad_limit({.peak_force_N = 5.0f}), "");  // as much as a program may
  EXPECT_EQ(bad_limit({.peak_force_N = 8.5f, .force_fault_N = 8.5f}), "");
  EXPECT_EQ(bad_limit({.direct_hold_ticks = 100, .direct_fade_ticks = 100, .direct_lost_ticks = 200}), "");
  // The currents of a hotter part would fold within too few ticks.
  EXPECT_EQ(bad_limit({.winding_s = 8.0f}), "");
  EXPECT_EQ(bad_limit({.winding_s = 7.0f}), "heat_fold");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {1.24f, 1.24f, 0.9f}}), "heat_fold");
  EXPECT_EQ(bad_limit({.motor_continuous_A = {0.9f, 1.24f, 1.24f}}), "heat_fold");
  // By exactly 0.5 N a tick they may: 125 N of which 1 A in 2 goes, 4 times 0.5 ms a second by half of the
  // way.
  Limits exact{.peak_force_N = 125.0f,
               .motor_current_A = {2.0f, 1.0f, 1.0f},
               .over_current_ratio = 1.0f,
               .motor_continuous_A = {1.0f, 1.0f, 1.0f},
               .winding_share = 0.5f,
               .winding_s = 1.0f,
               .heat_fold = 0.5f};
  EXPECT_TRUE(folds_smoothly(exact));
  exact.peak_force_N = std::nextafter(std::nextafter(125.0f, 200.0f), 200.0f);
  EXPECT_FALSE(folds_smoothly(exact));
}

// Ticks until a board whose servo misses a deadline in each `period_ticks` switches off; most if it does not.
std::uint32_t ticks_to_fault(const Limits& limits, std::uint32_t period_ticks, std::uint32_t most) {
  SupervisorState state{.mode = Mode::render};
  for (std::uint32_t tick = 0; tick < most; ++tick) {
    const SupervisorInputs in{.tick = tick, .missed_deadlines = tick % period_ticks == 0 ? 1u : 0u};
    state = supervise(state, in, limits, 1).state;
    if (state.faults != 0) return tick;
  }
  return most;
}

TEST(LimitRanges, NoneOfThemForgivesEveryMissedDeadline) {
  constexpr std::uint32_t kMost = 100'000;
  for (const std::uint32_t weight : {20u, 100u, 1000u}) {
    Limits limits{.missed_deadline_weight = weight, .missed_deadline_bucket = 10 * weight};
    if (limits.missed_deadline_bucket > 1000) limits.missed_deadline_bucket = 1000;
    ASSERT_EQ(bad_limit(limits), "");
    EXPECT_LE(ticks_to_fault(limits, 1, kMost), kMostMissedDeadlines) << weight;
    EXPECT_LT(ticks_to_fault(limits, 19, kMost), kMost) << weight;
  }
}

}  // namespace
}  // namespace palpate::firmware
