#include "host/session/body_surface.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "host/msd/tangent.hpp"
#include "host/msd/vectors.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::message_of;
using test::Path;
using test::Touched;

// Rounding of some tens of operations in double, relative.
constexpr double kRounding = 1e-12;

TEST(StepsPerTick, TheStepDividesTheTick) {
  EXPECT_EQ(steps_per_tick(1e-3), 1);
  EXPECT_EQ(steps_per_tick(1e-4), 10);
  EXPECT_EQ(steps_per_tick(1.25e-5), 80);
  EXPECT_EQ(steps_per_tick(1e-3 / 3.0), 3);
}

TEST(StepsPerTick, RefusesOthers) {
  for (const double step_s : {0.0, -1e-4, 3e-4, 2e-3, 1.0001e-4, std::numeric_limits<double>::quiet_NaN(),
                              std::numeric_limits<double>::infinity()}) {
    const std::string message = message_of<std::invalid_argument>([&] { (void)steps_per_tick(step_s); });
    EXPECT_NE(message.find("step_s"), std::string::npos) << step_s;
  }
}

TEST(BodySurface, RefusesAnUnstableStep) {
  const Body body = block(4);
  for (const double step_s : {0.0, 1e-3, std::numeric_limits<double>::quiet_NaN()}) {
    const std::string message =
        message_of<std::invalid_argument>([&] { BodySurface(body, body.rest_state(), step_s); });
    EXPECT_NE(message.find("step_s"), std::string::npos) << step_s;
    EXPECT_NE(message.find("must be in (0, "), std::string::npos) << step_s;
  }
}

TEST(BodySurface, NeighboursShareTheEdgeOppositeToTheCorner) {
  const Body body = block(4);
  const BodySurface surface(body, body.rest_state(), 1e-4);
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const auto mine = surface.corners(t);
    for (std::uint32_t c = 0; c < 3; ++c) {
      const std::int32_t across = surface.neighbour(t, c);
      ASSERT_GE(across, 0);  // the surface is closed
      const auto theirs = surface.corners(static_cast<std::uint32_t>(across));
      const auto has = [&](std::uint32_t node) {
        return std::count(theirs.begin(), theirs.end(), node) == 1;
      };
      EXPECT_TRUE(has(mine[(c + 1) % 3]) && has(mine[(c + 2) % 3]) && !has(mine[c]));
    }
  }
}

TEST(BodySurface, RespondPredictsWhatApplyDoes) {
  const Body body = block(4);
  BodySurface surface(body, test::random_state(body, 1, 5e-4, 0.05), 1e-4);
  const Vec3d force_N{0.7, -0.4, -1.3};
  bool fixed_corner_seen = false;
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const auto corner = surface.corners(t);
    const Vec3d barycentric{0.5, 0.2, 0.3};
    const auto point_m = [&] {
      Vec3d sum{};
      for (std::size_t c = 0; c < 3; ++c) sum += surface.position(corner[c]) * barycentric[c];
      return sum;
    };
    surface.advance();
    const auto response = surface.respond(t, barycentric);
    EXPECT_LE(norm(response.free_m - point_m()), kRounding * norm(response.free_m));
    std::array<Vec3d, 3> before_m;
    for (std::size_t c = 0; c < 3; ++c) before_m[c] = surface.position(corner[c]);
    surface.apply(t, barycentric, force_N);
    const Vec3d predicted_m = response.free_m + response.compliance_m_N * force_N;
    EXPECT_LE(norm(point_m() - predicted_m), kRounding * norm(predicted_m));
    for (std::size_t c = 0; c < 3; ++c) {
      if (!body.fixed(static_cast<int>(corner[c]))) continue;
      fixed_corner_seen = true;
      EXPECT_EQ(surface.position(corner[c]), before_m[c]);
    }
  }
  EXPECT_TRUE(fixed_corner_seen);
}

TEST(BodySurface, AForceIsAnImpulseOnTheBody) {
  const Body body = block(4);
  BodySurface surface(body, body.rest_state(), 1e-4);
  const std::uint32_t top = surface.triangle_count() - 1;
  const Vec3d force_N{0.3, -0.2, -1.0};
  surface.apply(top, {0.2, 0.3, 0.5}, force_N);
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();
  for (int n = 0; n < body.node_count(); ++n)
    momentum += body.mass_kg(n) * surface.state().velocity_m_s.col(n);
  EXPECT_LE((momentum - 1e-4 * to_eigen(force_N)).norm(), kRounding * 1e-4);
}

TEST(BodySurface, NormalsAreContinuousAcrossEdges) {
  const Body body = block(4);
  BodySurface surface(body, test::random_state(body, 2, 2e-3, 0.0), 1e-4);
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const auto mine = surface.corners(t);
    for (std::uint32_t c = 0; c < 3; ++c) {
      const auto across = static_cast<std::uint32_t>(surface.neighbour(t, c));
      const auto theirs = surface.corners(across);
      for (const double s : {0.0, 0.3, 0.5, 1.0}) {
        Vec3d here{}, there{};
        here[(c + 1) % 3] = s;
        here[(c + 2) % 3] = 1.0 - s;
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t j = 0; j < 3; ++j)
            if (theirs[k] == mine[j]) there[k] = here[j];
        const Vec3d normal = surface.normal_before(t, here);
        EXPECT_LE(norm(normal - surface.normal_before(across, there)), kRounding);
        EXPECT_NEAR(norm(normal), 1.0, kRounding);
      }
    }
  }
}

TEST(BodySurface, FlatNormalsAreThoseOfTheTriangles) {
  const Body body = block(4);
  const BodySurface surface(body, test::random_state(body, 2, 2e-3, 0.0), 1e-4, SurfaceKind::flat);
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const auto corner = surface.corners(t);
    const Vec3d normal = surface.normal_before(t, {0.7, 0.1, 0.2});
    EXPECT_NEAR(norm(normal), 1.0, kRounding);
    const Vec3d first = surface.position(corner[1]) - surface.position(corner[0]);
    const Vec3d second = surface.position(corner[2]) - surface.position(corner[0]);
    EXPECT_LE(std::abs(dot(normal, first)), kRounding);
    EXPECT_LE(std::abs(dot(normal, second)), kRounding);
    EXPECT_GT(dot(normal, cross(first, second)), 0.0);
  }
}

TEST(BodySurface, NormalsPointOutward) {
  const Body body = block(4);
  const BodySurface surface(body, body.rest_state(), 1e-4);
  const Eigen::Vector3d centre = body.rest_position_m().rowwise().mean();
  for (std::uint32_t t = 0; t < surface.triangle_count(); ++t) {
    const auto corner = surface.corners(t);
    const Vec3d middle_m =
        (surface.position(corner[0]) + surface.position(corner[1]) + surface.position(corner[2])) *
        (1.0 / 3.0);
    EXPECT_GT(dot(surface.normal_before(t, {1.0 / 3, 1.0 / 3, 1.0 / 3}), middle_m - from_eigen(centre)), 0.0);
  }
}

// Force of the linear body, bottom fixed, on a point of its surface that is displaced by displacement_m: K x
// = W f, W' x = displacement.
Vec3d static_force_N(const Body& body, std::uint32_t triangle, const Vec3d& barycentric,
                     const Vec3d& displacement_m) {
  const Eigen::SparseMatrix<double> stiffness = -tangent(body, body.rest_state()).df_dx_N_m;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(stiffness);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(body.dof_count(), 3);
  for (std::size_t c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis)
      weights(body.dof(body.triangles()[triangle][c], axis), axis) = barycentric[c];
  const Eigen::Matrix3d compliance = weights.transpose() * solver.solve(weights);
  return from_eigen(Eigen::Vector3d(compliance.inverse() * to_eigen(displacement_m)));
}

TEST(AdvanceTick, AShallowPressHasTheForceOfTheLinearBody) {
  const Body body = block(5);
  double previous_error = 0.0;
  for (const double depth_m : {4e-5, 2e-5, 1e-5}) {
    BodySurface surface(body, body.rest_state(), 1e-4, SurfaceKind::smooth, {},
                        {.elsewhere = {100.0, 100.0}, .regions = {}});
    ContactState<double> contact;
    const ContactLaw<double> law{};
    Path path({0.0175, 0.0215, 1e-3});
    path.to({0.0175, 0.0215, -depth_m}, 100).hold(600);
    BodyTick last;
    for (std::size_t i = 1; i < path.tip_m.size(); ++i)
      last = advance_tick(surface, contact, law, path.tip_m[i - 1], path.tip_m[i]);
    ASSERT_EQ(contact.mode, ContactMode::stick);
    // At rest the force has settled: its change over the last tick is nothing beside the tolerance.
    Vec3d touched_m{};
    for (std::size_t c = 0; c < 3; ++c)
      touched_m += from_eigen(body.rest_position_m().col(body.triangles()[contact.triangle][c])) *
                   contact.barycentric[c];
    const Vec3d expected_N =
        static_force_N(body, contact.triangle, contact.barycentric, path.tip_m.back() - touched_m);
    const double error = norm(last.mean_force_N - expected_N) / norm(expected_N);
    // Springs turn by depth / spacing: the relative error of the linear force is of that order, here up to
    // twice it.
    EXPECT_LE(error, 2.0 * depth_m / 0.01) << depth_m;
    if (previous_error > 0.0) {
      EXPECT_NEAR(error / previous_error, 0.5, 0.1) << depth_m;
    }
    previous_error = error;
    EXPECT_NEAR(last.normal.z, 1.0, 0.01);
  }
}

class FrictionCone : public ::testing::TestWithParam<double> {};

TEST_P(FrictionCone, IsNeverViolated) {
  const double mu = GetParam();
  const Body body = block(5);
  Touched touched(body, {.elsewhere = {mu, mu}, .regions = {}});
  Path path({0.0115, 0.0215, 2e-3});
  path.to({0.0115, 0.0215, -3e-3}, 100).to({0.0325, 0.0245, -3e-3}, 250).to({0.0305, 0.0155, -2e-3}, 100);
  int checked = 0, slipping = 0, crossings = 0;
  double largest_ratio = 0.0;
  touched.follow(path, [&](const ContactState<double>& before, const ContactState<double>& after) {
    if (before.mode == ContactMode::free || after.mode == ContactMode::free) return;
    ++checked;
    slipping += after.mode == ContactMode::slip;
    crossings += before.triangle != after.triangle;
    const Vec3d normal = after.normal;
    const double pressing_N = -dot(after.force_N, normal);
    const double tangential_N = norm(after.force_N + normal * pressing_N);
    ASSERT_GE(pressing_N, 0.0);
    ASSERT_LE(tangential_N, mu * pressing_N + kRounding * norm(after.force_N) * 10.0);
    largest_ratio = std::max(largest_ratio, tangential_N / pressing_N);
  });
  EXPECT_GT(checked, 4000);
  EXPECT_GT(slipping, 100);
  EXPECT_GE(crossings, mu < 1.0 ? 3 : 1);
  // The cone is reached.
  EXPECT_NEAR(largest_ratio, mu, 1e-9);
}
INSTANTIATE_TEST_SUITE_P(Coefficients, FrictionCone, ::testing::Values(0.0, 0.3, 1.0));

TEST(AdvanceTick, NothingPulls) {
  const Body body = block(4);
  BodySurface surface(body, body.rest_state(), 1e-4, SurfaceKind::smooth, {},
                      {.elsewhere = {1.0, 1.0}, .regions = {}});
  ContactState<double> contact;
  const ContactLaw<double> law{};
  Path path({0.0175, 0.0155, 1e-3});
  path.to({0.0175, 0.0155, -3e-3}, 60).to({0.0175, 0.0155, 0.02}, 30).hold(20);
  bool touched = false;
  for (std::size_t i = 1; i < path.tip_m.size(); ++i) {
    const BodyTick tick = advance_tick(surface, contact, law, path.tip_m[i - 1], path.tip_m[i]);
    EXPECT_LE(tick.mean_force_N.z, 0.0) << "tick " << i;
    touched |= tick.contact.mode != ContactMode::free;
    EXPECT_EQ(tick.normal == Vec3d{}, tick.contact.mode == ContactMode::free && tick.mean_force_N == Vec3d{});
  }
  EXPECT_TRUE(touched);
  EXPECT_EQ(contact.mode, ContactMode::free);
  EXPECT_EQ(contact.force_N, Vec3d{});
}

// The tip turns the normal as it slides; each of the tick's forces lies in its own.
TEST(AdvanceTick, WithoutFrictionTheMeanForceLiesInTheNormal) {
  const Body body = block(5);
  BodySurface surface(body, body.rest_state(), 1e-4);
  ContactState<double> contact;
  const ContactLaw<double> law{};
  Path path({0.0115, 0.0215, 2e-3});
  path.to({0.0115, 0.0215, -3e-3}, 100).to({0.0325, 0.0245, -3e-3}, 250).to({0.0325, 0.0245, 2e-3}, 50);
  int pressed = 0;
  double largest_turn = 0.0;
  for (std::size_t i = 1; i < path.tip_m.size(); ++i) {
    const BodyTick tick = advance_tick(surface, contact, law, path.tip_m[i - 1], path.tip_m[i]);
    if (tick.mean_force_N == Vec3d{}) continue;
    ++pressed;
    EXPECT_NEAR(norm(tick.normal), 1.0, kRounding);
    const double pressing_N = -dot(tick.mean_force_N, tick.normal);
    EXPECT_LE(norm(tick.mean_force_N + tick.normal * pressing_N), kRounding * pressing_N) << "tick " << i;
    largest_turn = std::max(largest_turn, norm(tick.normal - contact.normal));
  }
  EXPECT_GT(pressed, 200);
  EXPECT_GT(largest_turn, 1e-6);  // the steps' normals do differ
}

TEST(AdvanceTick, ATriangleOfFixedNodesIsASpringBeforeAWall) {
  const Body body = block(4);
  BodySurface surface(body, body.rest_state(), 1e-4, SurfaceKind::smooth, {},
                      {.elsewhere = {1.0, 1.0}, .regions = {}});
  ContactState<double> contact;
  const ContactLaw<double> law{};
  // From below, where all nodes are fixed.
  Path path({0.0175, 0.0155, -0.032});
  path.to({0.0175, 0.0155, -0.0295}, 50).hold(1);
  BodyTick last;
  for (std::size_t i = 1; i < path.tip_m.size(); ++i)
    last = advance_tick(surface, contact, law, path.tip_m[i - 1], path.tip_m[i]);
  EXPECT_NEAR(last.mean_force_N.z, kSkinStiffness_N_m * 0.0005, 1e-3);
  // Rest lengths are rounded: springs at rest move nodes by the last bit of their position.
  EXPECT_LE((surface.state().position_m - body.rest_position_m()).cwiseAbs().maxCoeff(), 1e-16);
}

// Over fixed nodes friction builds up with the spring, and then goes on: a slip does not let go of it.
TEST(AdvanceTick, ADragOverFixedNodesSlipsSteadily) {
  constexpr double kFriction = 0.3, kDepth_m = 0.001, kDrag_m = 0.006;
  constexpr int kTicks = 300;
  const Body body = block(4);
  BodySurface surface(body, body.rest_state(), 1e-4, SurfaceKind::smooth, {},
                      {.elsewhere = {kFriction, kFriction}, .regions = {}});
  ContactState<double> contact;
  const ContactLaw<double> law{};
  // From below, where all nodes are fixed.
  const double bottom_m = -0.03;
  Path path({0.0115, 0.0155, bottom_m - 0.001});
  path.to({0.0115, 0.0155, bottom_m + kDepth_m}, 50);
  const std::size_t pressed = path.tip_m.size();
  path.to({0.0115 + kDrag_m, 0.0155, bottom_m + kDepth_m}, kTicks);
  const double cone_N = kFriction * kSkinStiffness_N_m * kDepth_m;
  double before_N = 0.0;
  int slipping = 0;
  for (std::size_t i = 1; i < path.tip_m.size(); ++i) {
    const BodyTick tick = advance_tick(surface, contact, law, path.tip_m[i - 1], path.tip_m[i]);
    if (i < pressed) continue;
    const double along_N = tick.mean_force_N.x;
    slipping += contact.mode == ContactMode::slip;
    EXPECT_GE(along_N, before_N - kRounding * cone_N) << i;
    EXPECT_LE(along_N, cone_N * (1.0 + kRounding)) << i;
    before_N = along_N;
  }
  // It sticks for cone / skin = 0.3 mm of 6: in a path that begins at rest, for a seventh of the time.
  EXPECT_GT(slipping, kTicks * 6 / 7 - 1);
  EXPECT_NEAR(before_N, cone_N, kRounding);
}

}  // namespace
}  // namespace palpate::host
