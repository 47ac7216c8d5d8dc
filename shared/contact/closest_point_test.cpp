#include "shared/contact/closest_point.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

TEST(ClosestPoint, NoPointOfTheTriangleIsCloser) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Vec3d{uniform(random), uniform(random), uniform(random)}; };
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3d a = vector(), b = vector(), c = vector(), p = vector() * 2.0;
    const auto nearest = closest_point(p, a, b, c);
    const Vec3d rebuilt = a * nearest.barycentric.x + b * nearest.barycentric.y + c * nearest.barycentric.z;
    EXPECT_LT(norm(rebuilt - nearest.position), 1e-12);
    EXPECT_NEAR(nearest.barycentric.x + nearest.barycentric.y + nearest.barycentric.z, 1.0, 1e-12);
    const double distance = norm(p - nearest.position);
    constexpr int kGrid = 40;
    for (int i = 0; i <= kGrid; ++i) {
      for (int j = 0; i + j <= kGrid; ++j) {
        const double v = static_cast<double>(i) / kGrid, w = static_cast<double>(j) / kGrid;
        EXPECT_GE(norm(p - (a * (1 - v - w) + b * v + c * w)), distance - 1e-12);
      }
    }
  }
}

TEST(ClosestPoint, DegenerateTriangleIsFinite) {
  const Vec3d a{0, 0, 0}, b{1, 0, 0};
  for (const Vec3d& p : {Vec3d{0.3, 1, 0}, Vec3d{-1, 0, 0}, Vec3d{0, 0, 0}}) {
    EXPECT_TRUE(is_finite(closest_point(p, a, a, a).position));
    EXPECT_TRUE(is_finite(closest_point(p, a, b, b).position));
    EXPECT_TRUE(is_finite(closest_point(p, a, b, a).position));
  }
}

}  // namespace
}  // namespace palpate
