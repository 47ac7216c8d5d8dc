#include "host/session/tip_forecast.hpp"

#include <gtest/gtest.h>

#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using Eigen::Vector3d;

// A block of 6 x 6 x 6 nodes, 1 cm apart, its top at z = 0.
class TipForecastTest : public ::testing::Test {
 protected:
  SurfacePoint over(const Vector3d& tip_m) const { return nearest_surface_point(body_, position_m_, tip_m); }
  void note(std::uint32_t tick, const Vector3d& tip_m) {
    forecast_.note(tick, tip_m, position_m_, over(tip_m));
  }
  // Where the tip will be on the surface; fails where there is no place.
  Vector3d place_m(double ticks) const {
    const auto place = forecast_.place(ticks, 1e-2);
    EXPECT_TRUE(place);
    return place ? surface_position_m(body_, position_m_, *place) : Vector3d::Zero();
  }

  Body body_ = test::block(6);
  Eigen::Matrix3Xd position_m_ = body_.rest_position_m();
  TipForecast forecast_{body_};
};

TEST_F(TipForecastTest, StaysWhereItsSpeedIsUnknown) {
  EXPECT_FALSE(forecast_.place(10, 1.0));
  note(5, {0.012, 0.021, 2e-3});
  EXPECT_FALSE(forecast_.moves());
  EXPECT_LT((place_m(100) - Vector3d(0.012, 0.021, 0)).norm(), 1e-12);
  note(5, {0.012, 0.021, 2e-3});  // no news
  EXPECT_FALSE(forecast_.moves());
}

TEST_F(TipForecastTest, GoesOnAtTheMeanSpeed) {
  note(10, {0.012, 0.021, 2e-3});
  note(30, {0.014, 0.020, 2e-3});
  EXPECT_TRUE(forecast_.moves());
  EXPECT_LT((place_m(0) - Vector3d(0.014, 0.020, 0)).norm(), 1e-12);
  EXPECT_LT((place_m(40) - Vector3d(0.018, 0.018, 0)).norm(), 1e-12);
}

TEST_F(TipForecastTest, DoesNotGoThroughTheBody) {
  // Straight down: without the surface's plane it came out at the other side.
  note(10, {0.012, 0.021, 2e-3});
  note(20, {0.012, 0.021, -1e-3});
  EXPECT_LT((place_m(100) - Vector3d(0.012, 0.021, 0)).norm(), 1e-12);
  // Down and along.
  note(30, {0.014, 0.021, -2e-3});
  EXPECT_LT((place_m(100) - Vector3d(0.034, 0.021, 0)).norm(), 1e-12);
}

TEST_F(TipForecastTest, KnowsNoPlaceFarFromTheSurface) {
  note(10, {0.012, 0.021, 2e-3});
  note(20, {0.012, 0.021, 5e-3});
  EXPECT_TRUE(forecast_.place(10, 1e-2));
  EXPECT_FALSE(forecast_.place(20, 1e-2));
}

}  // namespace
}  // namespace palpate::host
