// The tip beyond the border of the surface that is known: the plane of the contact goes on there.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "shared/contact/test_bed.hpp"

namespace palpate {
namespace {

using test::Bed;
using test::kNothing;
using test::move;

constexpr double kBorder_m = (Bed::kSide - 1) * Bed::kSpacing_m;
constexpr double kDepth_m = 0.002;
// The longest edge of a triangle at rest; pressed in, it is a little longer.
const double kEdge_m = Bed::kSpacing_m * std::sqrt(2.0);
// 50 mm/s: a step of 5 um.
constexpr double kSpeed_m_s = 0.05;

struct Drag {
  explicit Drag(const Friction<double>& friction) : bed(friction) {
    tip = move(bed, state, {}, {kBorder_m - 0.006, 0.023, 0.005}, {kBorder_m - 0.006, 0.023, -kDepth_m}, 0.3,
               kNothing);
  }
  template <class After>
  void to(double x_m, After after) {
    tip = move(bed, state, {}, tip, {x_m, 0.023, -kDepth_m}, std::abs(x_m - tip.x) / kSpeed_m_s, after);
  }
  Bed bed;
  ContactState<double> state;
  Vec3d tip;
};

TEST(Border, TheForceIsContinuousBoundedAndNeverPulls) {
  for (const double mu : {0.0, 0.3, 1.0}) {
    Drag drag({mu, mu});
    Vec3d before_N = drag.state.force_N;
    double at_border_N = 0, largest_jump_N = 0;
    drag.to(kBorder_m + 4.0 * kEdge_m, [&](const Vec3d& tip) {
      const double pressing_N = -dot(drag.state.normal, drag.state.force_N);
      if (drag.state.mode != ContactMode::free) {
        EXPECT_GE(pressing_N, 0.0);
      }
      if (!drag.state.at_border) at_border_N = std::max(at_border_N, norm(drag.state.force_N));
      // The border's node is as stiff as can be: beyond it nothing grows, but for what rings on (5 %).
      EXPECT_LE(norm(drag.state.force_N), 1.05 * at_border_N) << tip.x;
      largest_jump_N = std::max(largest_jump_N, norm(drag.state.force_N - before_N));
      before_N = drag.state.force_N;
    });
    // Where the plane begins to go down, the node's speed along the normal changes by the tip's own within a
    // step, of 5 um: 5 um / (h^2 / m) = 0.5 N at a node of 1 g, and as much again along the surface.
    EXPECT_LE(largest_jump_N, 1.0) << mu;
    EXPECT_EQ(drag.state.mode, ContactMode::free);
    EXPECT_EQ(drag.state.force_N, Vec3d{});
  }
}

TEST(Border, TheContactGoesOnForHalfACellAndEnds) {
  Drag drag({0.5, 0.5});
  double last_m = 0;
  drag.to(kBorder_m + kLevelOverhang * kEdge_m - 0.001,
          [&](const Vec3d&) { EXPECT_NE(drag.state.mode, ContactMode::free); });
  EXPECT_TRUE(drag.state.at_border);
  EXPECT_NEAR(drag.state.overhang_m.x, drag.tip.x - kBorder_m, 1e-3);
  drag.to(kBorder_m + 4.0 * kEdge_m, [&](const Vec3d& tip) {
    if (drag.state.mode != ContactMode::free) last_m = tip.x - kBorder_m;
  });
  // The plane has gone down by the depth at the latest.
  EXPECT_LE(last_m, kLevelOverhang * 1.05 * kEdge_m + kDepth_m + 1e-3);
}

// The border does not draw the tip back: at rest beyond it, the force along the surface fades away or stays
// within what friction held when the tip stopped; without friction there is none.
TEST(Border, ATipAtRestBeyondItIsNotDrawnBack) {
  Drag drag({0.0, 0.0});
  drag.to(kBorder_m + 0.005, kNothing);
  move(drag.bed, drag.state, {}, drag.tip, drag.tip, 0.5, kNothing);
  ASSERT_NE(drag.state.mode, ContactMode::free);
  const double along_N =
      norm(drag.state.force_N + drag.state.normal * -dot(drag.state.normal, drag.state.force_N));
  EXPECT_LE(along_N, 1e-12);
}

TEST(Border, ComingBackTheContactIsThatOfTheSurface) {
  Drag drag({0.3, 0.3});
  drag.to(kBorder_m + 0.005, kNothing);
  drag.to(kBorder_m - 0.006, kNothing);
  ASSERT_NE(drag.state.mode, ContactMode::free);
  EXPECT_FALSE(drag.state.at_border);
  EXPECT_EQ(drag.state.overhang_m, Vec3d{});
  EXPECT_GE(-drag.state.force_N.z, 0.0);
}

// Beyond the border the contact sticks, and draws the border along: coming back the tip has another closest
// place on it when it slips. It goes there without a leap, and is not lost.
TEST(Border, RandomReturnsKeepTheContact) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0.0, 1.0), both(-1.0, 1.0);
  constexpr double kFastest_m_s = 0.2;
  int sideways = 0;
  for (int i = 0; i < 500; ++i) {
    const double mu = 0.7 * share(random), depth_m = 0.001 + 0.002 * share(random);
    Bed bed({mu, mu});
    ContactState<double> state;
    Vec3d tip{kBorder_m - 0.006, 0.013 + 0.024 * share(random), 0.002};
    bool lost = false;
    double largest_jump_N = 0;
    Vec3d before_N{};
    const auto go = [&](const Vec3d& to, double speed_m_s) {
      lost = false;
      largest_jump_N = 0;
      tip = move(bed, state, {}, tip, to, norm(to - tip) / speed_m_s, [&](const Vec3d&) {
        lost |= state.mode == ContactMode::free;
        largest_jump_N = std::max(largest_jump_N, norm(state.force_N - before_N));
        before_N = state.force_N;
      });
    };
    const auto settle = [&] { move(bed, state, {}, tip, tip, 0.05, kNothing); };
    go({tip.x, tip.y, -depth_m}, 0.05);
    settle();
    // Not to where the plane goes down: there it would push the tip that comes back.
    const double out_m = 0.001 + 0.0055 * share(random);
    go({kBorder_m + out_m, tip.y + 0.008 * both(random), -depth_m}, 0.05);
    ASSERT_FALSE(lost) << i;
    settle();
    before_N = state.force_N;
    ASSERT_GT(norm(state.overhang_m), 0.0) << i;
    sideways += std::abs(state.overhang_m.y) > 1e-4;
    const double speed_m_s = 0.02 + (kFastest_m_s - 0.02) * share(random);
    go({kBorder_m - 0.012, 0.025 + 0.015 * both(random), -depth_m}, speed_m_s);
    EXPECT_FALSE(lost) << i << " friction " << mu;
    EXPECT_EQ(state.overhang_m, Vec3d{}) << i;
    // The contact point goes at most twice as fast as the tip, along the surface and across, and takes at
    // most three nodes' mass with it.
    const double largest_m_s = std::sqrt(2.0) * kOverhangChange * speed_m_s;
    EXPECT_LE(largest_jump_N, 3.0 * largest_m_s * Bed::kMass_kg / Bed::kStep_s) << i;
  }
  EXPECT_GT(sideways, 5);
}

// Lost beyond the border, deep inside: under the surface again it is pushed out like one that starts there.
TEST(Border, ATipThatComesBackUnderTheSurfaceIsMetWithoutAJump) {
  Drag drag({0.3, 0.3});
  drag.to(kBorder_m + 4.0 * kEdge_m, kNothing);
  ASSERT_EQ(drag.state.mode, ContactMode::free);
  drag.tip.z = -0.004;
  double largest_N = 0;
  bool met = false;
  drag.tip =
      move(drag.bed, drag.state, {}, drag.tip, {kBorder_m - 0.004, 0.023, -0.004}, 1.0, [&](const Vec3d&) {
        largest_N = std::max(largest_N, -dot(drag.state.normal, drag.state.force_N));
        met |= drag.state.inset_m > 0.0;
      });
  EXPECT_TRUE(met);
  EXPECT_LE(largest_N, kPushOut_N);
}

}  // namespace
}  // namespace palpate
