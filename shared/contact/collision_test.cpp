// What a tip may have passed within a step.
#include "shared/contact/collision.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "shared/contact/test_grid.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t kSide = 4;
constexpr double kCell_m = 0.01;

// A grid of nodes that a test moves as it likes within one step.
class Crumpled {
 public:
  std::uint32_t triangle_count() const { return triangles_.count(); }
  std::array<std::uint32_t, 3> corners(std::uint32_t t) const { return triangles_[t]; }
  std::int32_t neighbour(std::uint32_t t, std::uint32_t c) const { return triangles_.neighbour(t, c); }
  bool may_touch(std::uint32_t, const Vec3d&, const Vec3d&, double) const { return true; }
  Vec3d position(std::uint32_t node) const { return after_m[node]; }
  Vec3d position_before(std::uint32_t node) const { return before_m[node]; }

  std::vector<Vec3d> before_m{kSide * kSide}, after_m{kSide * kSide};

 private:
  test::GridTriangles triangles_{kSide};
};

// Does the tip go through a triangle from front to back? Looked at in small parts of the step, on their own.
bool passes(Crumpled& surface, const contact_detail::TipMotion<double>& motion) {
  constexpr int kParts = 200;
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    double height_before = 0;
    for (int i = 0; i <= kParts; ++i) {
      const double s = static_cast<double>(i) / kParts;
      const auto x = contact_detail::corners_at(surface, t, s);
      const Vec3d tip = contact_detail::lerp(motion.from_m, motion.to_m, s);
      const double height = contact_detail::height_over(tip, x);
      const Vec3d foot = closest_point(tip, x[0], x[1], x[2]).barycentric;
      const bool inner = std::min({foot.x, foot.y, foot.z}) > 0;
      if (i > 0 && inner && height_before >= 0 && height < 0) return true;
      height_before = height;
    }
  }
  return false;
}

// Whatever the nodes do, however much faster than the closest ones others are.
TEST(Collision, ATipThatHasPassedATriangleCouldHave) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> both(-1.0, 1.0);
  const auto vector = [&] { return Vec3d{both(random), both(random), both(random)}; };
  int passed = 0, outside = 0, slow = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    Crumpled surface;
    for (std::uint32_t n = 0; n < kSide * kSide; ++n) {
      const Vec3d rest{kCell_m * (n % kSide), kCell_m * (n / kSide), 0.0};
      surface.before_m[n] = rest + vector() * 0.01;
      surface.after_m[n] = surface.before_m[n] + vector() * (0.1 * std::pow(both(random), 12));
    }
    const Vec3d from{0.015 + 0.015 * both(random), 0.015 + 0.015 * both(random), 0.01 * both(random)};
    const contact_detail::TipMotion<double> motion{from, from + vector() * 0.002, 0.0};
    if (!passes(surface, motion)) continue;
    ++passed;
    const auto end = contact_detail::closest_on_surface(surface, motion.to_m, 1.0, motion,
                                                        contact_detail::Search::everywhere);
    EXPECT_TRUE(contact_detail::could_have_crossed(surface, motion, end)) << trial;
    const double left_m = end.distance_m - norm(motion.to_m - motion.from_m);
    outside += left_m > 0;
    double closest_moved_m = 0;
    for (const std::uint32_t node : surface.corners(end.triangle))
      closest_moved_m = std::max(closest_moved_m, norm(surface.after_m[node] - surface.before_m[node]));
    slow += left_m > 2.0 * closest_moved_m;
  }
  EXPECT_GT(passed, 1000);
  EXPECT_GT(outside, 50);
  EXPECT_GT(slow, 10);  // the closest triangle's motion says nothing about it
}

}  // namespace
}  // namespace palpate
