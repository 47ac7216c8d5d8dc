#include "host/plant/hand_guide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace palpate::plant {
namespace {

TEST(HandGuide, ComesToItsTargetWithoutOvershoot) {
  HandGuide guide({}, {});
  guide.set_target({0.01, 0.0, 0.0});
  double farthest_m = 0.0;
  for (int tick = 0; tick < 1000; ++tick) farthest_m = std::max(farthest_m, guide.advance(1e-3).position_m.x);
  EXPECT_LE(farthest_m, 0.01);
  EXPECT_NEAR(guide.now().position_m.x, 0.01, 1e-9);
  EXPECT_NEAR(norm(guide.now().velocity_m_s), 0.0, 1e-7);
}

TEST(HandGuide, FollowsTheClosedFormOfACriticallyDampedStep) {
  // x(t) = 1 - (1 + w t) exp(-w t). Implicit Euler is of first order: its error is below w dt / 2 = 2 % of
  // the step at w dt = 0.04, the largest of |x''| dt / 2 integrated over a time constant.
  HandGuideParameters free;
  free.greatest_speed_m_s = 2.5;
  HandGuide guide(free, {});
  guide.set_target({0.0, 0.001, 0.0});
  for (int tick = 1; tick <= 200; ++tick) {
    const double wt = free.bandwidth_rad_s * tick * 1e-3;
    EXPECT_NEAR(guide.advance(1e-3).position_m.y, 0.001 * (1.0 - (1.0 + wt) * std::exp(-wt)), 2e-5) << tick;
  }
}

TEST(HandGuide, IsNeverFasterThanItsLimit) {
  HandGuide guide({.bandwidth_rad_s = 100.0, .greatest_speed_m_s = 0.2}, {});
  guide.set_target({1.0, -1.0, 1.0});
  Vec3d before_m{};
  for (int tick = 0; tick < 2000; ++tick) {
    const PathPoint now = guide.advance(1e-3);
    EXPECT_LE(norm(now.position_m - before_m), 0.2e-3 * (1.0 + 1e-9));
    EXPECT_LE(norm(now.velocity_m_s), 0.2 * (1.0 + 1e-9));
    before_m = now.position_m;
  }
}

TEST(HandGuide, RefusesWhatIsNotFiniteAndGoesOn) {
  HandGuide guide({}, {0.01, 0.0, 0.0});
  EXPECT_THROW(guide.set_target({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}), std::invalid_argument);
  EXPECT_THROW(HandGuide({.bandwidth_rad_s = 0.0}, {}), std::invalid_argument);
  EXPECT_EQ(guide.advance(1e-3).position_m.x, 0.01);
}

}  // namespace
}  // namespace palpate::plant
