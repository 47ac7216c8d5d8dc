#include "host/plant/tip_path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace palpate::plant {
namespace {

const std::vector<TimedPosition> kPoints{
    {0.5, {0.0, 0.0, 0.02}}, {1.0, {0.0, 0.01, -0.005}}, {3.0, {0.03, 0.01, -0.005}}};

TEST(TipPath, MinimumJerkMeetsItsWaypointsAtRest) {
  const TipPath path = TipPath::minimum_jerk(kPoints);
  for (const TimedPosition& waypoint : kPoints) {
    EXPECT_EQ(path.at(waypoint.time_s).position_m, waypoint.position_m);
    EXPECT_EQ(path.at(waypoint.time_s).velocity_m_s, Vec3d{});
    // Just before, so that the end of each movement is tested too: s(1 - e) = 1 - 10 e^3, s' = 30 e^2.
    constexpr double kBefore_s = 1e-6;
    EXPECT_LT(norm(path.at(waypoint.time_s - kBefore_s).position_m - waypoint.position_m), 1e-15);
    EXPECT_LT(norm(path.at(waypoint.time_s - kBefore_s).velocity_m_s), 1e-10);
  }
  EXPECT_EQ(path.first_time_s(), 0.5);
  EXPECT_EQ(path.last_time_s(), 3.0);
}

TEST(TipPath, MinimumJerkIsHalfWayInTheMiddleAndFastestThere) {
  const TipPath path = TipPath::minimum_jerk(kPoints);
  const PathPoint middle = path.at(2.0);
  EXPECT_NEAR(middle.position_m.x, 0.015, 1e-15);
  EXPECT_NEAR(middle.velocity_m_s.x, 1.875 * 0.03 / 2.0, 1e-15);  // s'(1/2) = 15/8
}

TEST(TipPath, VelocityIsTheDerivativeOfThePosition) {
  constexpr double kStep_s = 1e-5;
  constexpr double kError_m_s =
      1e-8;  // truncation: third derivative 60 * 0.03 m / (0.5 s)^3, times step^2 / 6
  for (const TipPath& path : {TipPath::minimum_jerk(kPoints), TipPath::samples(kPoints)})
    for (int i = 0; i < 200; ++i) {
      const double time_s = 0.50005 + 0.0124 * i;  // meets no waypoint
      const Vec3d difference_m_s =
          (path.at(time_s + kStep_s).position_m - path.at(time_s - kStep_s).position_m) * (0.5 / kStep_s);
      ASSERT_LT(norm(path.at(time_s).velocity_m_s - difference_m_s), kError_m_s) << time_s;
    }
}

TEST(TipPath, SamplesAreJoinedByStraightLines) {
  const TipPath path = TipPath::samples(kPoints);
  EXPECT_NEAR(path.at(1.5).position_m.x, 0.0075, 1e-15);
  EXPECT_NEAR(path.at(1.5).velocity_m_s.x, 0.015, 1e-15);
  EXPECT_EQ(path.at(1.0).position_m, kPoints[1].position_m);
  EXPECT_NEAR(path.at(1.0).velocity_m_s.x, 0.015, 1e-15);  // of the line that follows
}

TEST(TipPath, RestsBeforeTheFirstAndAfterTheLastPoint) {
  for (const TipPath& path : {TipPath::minimum_jerk(kPoints), TipPath::samples(kPoints)}) {
    EXPECT_EQ(path.at(-1.0).position_m, kPoints.front().position_m);
    EXPECT_EQ(path.at(-1.0).velocity_m_s, Vec3d{});
    EXPECT_EQ(path.at(9.0).position_m, kPoints.back().position_m);
    EXPECT_EQ(path.at(9.0).velocity_m_s, Vec3d{});
  }
}

TEST(TipPath, OnePointIsAPlace) {
  const TipPath path = TipPath::minimum_jerk({{0.0, {0.01, 0.02, 0.03}}});
  EXPECT_EQ(path.at(0.0).position_m, (Vec3d{0.01, 0.02, 0.03}));
  EXPECT_EQ(path.at(5.0).position_m, (Vec3d{0.01, 0.02, 0.03}));
}

std::string message_of(std::vector<TimedPosition> points) {
  try {
    TipPath::samples(std::move(points));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(TipPath, RefusesBadPointsByNumberValueAndRange) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(message_of({}), "tip path has 0 points, allowed: at least 1");
  EXPECT_EQ(message_of({{0.0, {}}, {0.0, {}}}),
            "tip path point 1: time 0 s, allowed: later than the previous point's 0 s");
  EXPECT_EQ(message_of({{0.0, {}}, {2.0, {}}, {1.5, {}}}),
            "tip path point 2: time 1.5 s, allowed: later than the previous point's 2 s");
  EXPECT_EQ(message_of({{0.0, {}}, {kNan, {}}}), "tip path point 1: time nan s, allowed: finite");
  EXPECT_EQ(message_of({{0.0, {0.0, kNan, 0.0}}}),
            "tip path point 0: position (0, nan, 0) m, allowed: finite");
}

}  // namespace
}  // namespace palpate::plant
