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
  EXPECT_EQ(bad_limit({.calibration_motion_count = -1}), "calibration_motion_count");
  EXPECT_EQ(bad_limit({.motor_current_A = {1.0f, 0.0f, 1.0f}}), "motor_current_A");
}

}  // namespace
}  // namespace palpate::firmware
