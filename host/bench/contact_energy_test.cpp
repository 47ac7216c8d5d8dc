#include "host/bench/contact_energy.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host/msd/test_bodies.hpp"
#include "shared/contact/contact_surface.hpp"

namespace palpate::host::bench {
namespace {

constexpr double kStep_s = 1e-4;

Body body_of(double damping_ratio) {
  LatticeSpec spec = test::reference_spec(8, damping_ratio);
  spec.nodes[2] = 4;
  return make_lattice(spec);
}

// Circles on the top, nodes every centimetre: within a triangle, over an edge, around a node, over 14
// triangles.
std::array<Loop, 4> loops(double speed_m_s) {
  const auto circle = [&](double x_m, double y_m, double radius_m) {
    Loop loop;
    loop.x_m = x_m;
    loop.y_m = y_m;
    loop.half_width_m = radius_m;
    loop.top_m = 0.03;
    loop.depth_m = 0.003;
    loop.speed_m_s = speed_m_s;
    return loop;
  };
  return {circle(0.0333, 0.0333, 0.0015), circle(0.035, 0.03, 0.002), circle(0.03, 0.03, 0.003),
          circle(0.035, 0.035, 0.009)};
}

TEST(EnergyAccount, SplitsTheHandsWork) {
  ContactState<double> contact;
  contact.mode = ContactMode::slip;
  contact.normal = {0, 0, 1};
  contact.force_N = {0.5, 0, -2};
  EnergyAccount account;
  // The tip goes 3 mm along and 1 mm down, the surface under it 1 mm along and 1 mm down.
  account.add(contact, false, {0.003, 0, -0.001}, {0.001, 0, -0.001});
  EXPECT_DOUBLE_EQ(account.hand_J, 0.0035);
  EXPECT_DOUBLE_EQ(account.body_J, 0.0025);
  EXPECT_DOUBLE_EQ(account.friction_J, 0.001);
  EXPECT_NEAR(account.created_J, 0.0, 1e-18);
  // The surface goes 1 mm further down than the tip.
  account.add(contact, false, {}, {0, 0, -0.001});
  EXPECT_NEAR(account.created_J, 0.002, 1e-18);
  // Friction that pushes the way the contact slips.
  account.add(contact, false, {-0.001, 0, 0}, {});
  EXPECT_NEAR(account.created_J, 0.0025, 1e-18);
  EXPECT_DOUBLE_EQ(account.friction_J, 0.001);
  // What a first contact loses makes up for nothing.
  account.add(contact, true, {0, 0, -0.001}, {});
  EXPECT_NEAR(account.created_J, 0.0025, 1e-18);
  EXPECT_DOUBLE_EQ(account.first_contact_J, -0.002);
}

TEST(TipPath, IsClosedAndAsFastAsAsked) {
  for (const double speed_m_s : {0.02, 0.2}) {
    for (Loop loop : loops(speed_m_s)) {
      for (const Loop::Shape shape : {Loop::Shape::circle, Loop::Shape::rectangle}) {
        loop.shape = shape;
        loop.half_height_m = 0.5 * loop.half_width_m;
        const auto tip_m = tip_path(loop);
        EXPECT_EQ(tip_m.front(), tip_m.back());
        double fastest_m_s = 0;
        for (std::size_t i = 1; i < tip_m.size(); ++i) {
          const Vec3d moved_m = tip_m[i] - tip_m[i - 1];
          fastest_m_s = std::max(fastest_m_s, std::hypot(moved_m.x, moved_m.y) / 1e-3);
        }
        // Durations are rounded up to whole ticks; chords are shorter than arcs.
        EXPECT_LE(fastest_m_s, speed_m_s * (1.0 + 1e-9));
        EXPECT_GE(fastest_m_s, 0.9 * speed_m_s);
      }
    }
  }
}

void expect_little_created(SurfaceKind kind, double friction) {
  const Body body = body_of(1.0);
  for (const double speed_m_s : {0.02, 0.2}) {
    for (const Loop& loop : loops(speed_m_s)) {
      SCOPED_TRACE(::testing::Message() << "radius " << loop.half_width_m << " m, " << speed_m_s << " m/s");
      const auto tip_m = tip_path(loop);
      const Vec3d centre_m{loop.x_m, loop.y_m, loop.top_m};
      const EnergyLoop patch = patch_loop(body, kind, friction, centre_m, tip_m);
      EXPECT_LE(patch.account.created_J, patch.bound_J());
      EXPECT_GT(patch.largest_force_N, 1.0);
      EXPECT_EQ(patch.lost, 1);
      // Exact modes: what the dampers take up is not negative.
      EXPECT_LE(patch.integrator_J, 0.0);
      if (speed_m_s < 0.1 && loop.half_width_m < 0.009) continue;  // as above, but slower to compute
      const EnergyLoop full = full_body_loop(body, kind, friction, kStep_s, tip_m);
      EXPECT_LE(full.account.created_J, full.bound_J());
      EXPECT_GT(full.largest_force_N, 1.0);
      // The account closes: what the body was given is in it or in its dampers.
      EXPECT_LE(std::abs(full.integrator_J), 0.05 * full.account.body_J);
    }
  }
}

class ClosedLoop : public ::testing::TestWithParam<double> {};

TEST_P(ClosedLoop, ASmoothSurfaceCreatesLittleEnergy) {
  expect_little_created(SurfaceKind::smooth, GetParam());
}
TEST_P(ClosedLoop, AFlatSurfaceCreatesLittleEnergy) {
  expect_little_created(SurfaceKind::flat, GetParam());
}
INSTANTIATE_TEST_SUITE_P(Friction, ClosedLoop, ::testing::Values(0.0, 0.3, 1.0));

// The top's nodes up to its middle do not yield: the tip goes from them to soft ones and back. On the full
// body also over triangles of three fixed nodes.
class FixedToSoft : public ::testing::TestWithParam<double> {};

TEST_P(FixedToSoft, NothingIsLostOrCreated) {
  const double mu = GetParam();
  LatticeSpec spec = test::reference_spec(8, 1.0);
  spec.nodes[2] = 4;
  for (int i = 0; i <= 3; ++i)
    for (int j = 0; j < 8; ++j) spec.fixed_nodes.push_back({i, j, 3});
  const Body body = make_lattice(spec);
  Loop loop;
  loop.shape = Loop::Shape::rectangle;
  loop.x_m = 0.035;
  loop.y_m = 0.035;
  loop.half_height_m = 0.008;
  loop.top_m = 0.03;
  loop.depth_m = 0.002;
  // Where the free nodes of a triangle have the weight b, a point gives way along any direction by at least
  //   b^2 / 3 / K + (1 - b) / skin,   K = 833 N/m:
  // |weights|^2 >= b^2 / 3; K bounds the stiffness of the free ones, all others held: 100 N/m x (2 + 4/2 +
  // 2/2 + 4/3) at each, 100 N/m to each of the other two. Of all b the stiffest is b = 3 K / (2 skin).
  // Friction adds to the force by the cone, and to what presses where it drives the surface up, along C_nt <=
  // C_nn. The material's dampers hold 4.5 ms, a hundredth of the time from node to node at 20 mm/s: 5 % for
  // the ways there and for what rings.
  constexpr double kNode_N_m = 833.0;
  const double stiffest_m_N = (1.0 - 0.75 * kNode_N_m / kSkinStiffness_N_m) / kSkinStiffness_N_m;
  const double largest_N = 1.05 * loop.depth_m / stiffest_m_N * std::sqrt(1.0 + mu * mu) / (1.0 - mu);
  for (const double speed_m_s : {0.02, 0.2}) {
    SCOPED_TRACE(::testing::Message() << speed_m_s << " m/s");
    loop.speed_m_s = speed_m_s;
    loop.half_width_m = 0.018;
    const EnergyLoop full = full_body_loop(body, SurfaceKind::smooth, mu, kStep_s, tip_path(loop));
    loop.half_width_m = 0.009;
    const EnergyLoop patch =
        patch_loop(body, SurfaceKind::smooth, mu, {loop.x_m, loop.y_m, loop.top_m}, tip_path(loop));
    for (const EnergyLoop& result : {full, patch}) {
      EXPECT_LE(result.account.created_J, result.bound_J());
      EXPECT_EQ(result.lost, 1);
      EXPECT_LE(result.largest_force_N, largest_N);
    }
    // A fixed place alone has this.
    EXPECT_GT(full.largest_force_N, 0.95 * kSkinStiffness_N_m * loop.depth_m);
    EXPECT_GT(full.triangles_crossed, 12);
  }
}
INSTANTIATE_TEST_SUITE_P(Friction, FixedToSoft, ::testing::Values(0.0, 0.3));

}  // namespace
}  // namespace palpate::host::bench
