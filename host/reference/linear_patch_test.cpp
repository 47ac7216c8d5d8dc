#include "host/reference/linear_patch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "host/reference/contact_runs.hpp"
#include "host/reference/paper_reference.hpp"
#include "host/reference/test_patches.hpp"

namespace palpate::host::paper {
namespace {

TEST(LinearPatch, HoldsThePaperPatchAndItsForces) {
  const Body body = make_lattice(test::reference_spec(6));
  const BodyState state = host::test::random_state(body, 1, 0.0005, 0.05);
  const SurfacePoint contact = nearest_surface_point(body, state.position_m, {0.025, 0.025, 0.06});
  const LinearPatch patch = linear_patch(body, state, contact, {4, 4, 2});
  EXPECT_EQ(patch.nodes(), 32);
  EXPECT_EQ(patch.corner.size(), 18U);
  // At X0, V0 the force is the body's; for equal motion of all of it nothing changes inside.
  EXPECT_LT((patch.force_N(patch.rest_position_m, patch.rest_velocity_m_s) - patch.rest_force_N).norm(),
            1e-15);
  for (const auto& corner : patch.corner) {
    const auto x = [&](int c) -> Eigen::Vector3d { return patch.rest_position_m.segment<3>(3 * c); };
    EXPECT_GT((x(corner[1]) - x(corner[0])).cross(x(corner[2]) - x(corner[0])).z(), 0.0);  // outward: up
  }
}

TEST(LinearPatch, TrianglesWithAFixedCornerAreLeftOut) {
  LatticeSpec spec = test::reference_spec(6);
  spec.fixed_nodes.push_back({2, 2, 5});
  const Body body = make_lattice(spec);
  const BodyState rest = body.rest_state();
  const SurfacePoint contact = nearest_surface_point(body, rest.position_m, {0.026, 0.026, 1.0});
  const LinearPatch patch = linear_patch(body, rest, contact, {4, 4, 2});
  EXPECT_EQ(patch.nodes(), 31);
  EXPECT_EQ(patch.corner.size(), 12U);  // six triangles meet in a node
}

TEST(LinearPatch, APlanarBodyIsRefused) {
  const Body body = make_lattice(host::test::planar_spec(6));
  EXPECT_THROW(linear_patch(body, body.rest_state(), {0, {1, 0, 0}}, {2, 1, 2}), std::invalid_argument);
}

// Largest displacement after many steps of the free patch from a random start: x with the old velocity as in
// (13), or with the new one as in (12).
double after_steps(const LinearPatch& patch, double step_s, bool new_velocity) {
  constexpr int kSteps = 4000;
  test::Random random(1);
  Eigen::VectorXd x = patch.rest_position_m + random.vector(patch.mass_kg.size(), 1e-3);
  Eigen::VectorXd v = Eigen::VectorXd::Zero(x.size());
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::VectorXd next = v + patch.force_N(x, v).cwiseQuotient(patch.mass_kg) * step_s;
    x += (new_velocity ? next : v) * step_s;
    v = next;
  }
  return (x - patch.rest_position_m).cwiseAbs().maxCoeff();
}

TEST(LinearPatch, TheLargestStableStepIsTheEdgeOfGrowth) {
  constexpr double kMargin = 0.02, kBounded_m = 0.01, kGrown_m = 1.0;
  for (const double damping_ratio : {0.1, 0.5, 1.0, 2.0}) {
    const LinearPatch patch = test::reference_patch(damping_ratio);
    const double below_s = largest_stable_step_s(patch) * (1 - kMargin);
    const double above_s = largest_stable_step_s(patch) * (1 + kMargin);
    EXPECT_LT(after_steps(patch, below_s, false), kBounded_m) << damping_ratio;
    EXPECT_LT(after_steps(patch, below_s, true), kBounded_m) << damping_ratio;
    EXPECT_GT(std::max(after_steps(patch, above_s, false), after_steps(patch, above_s, true)), kGrown_m)
        << damping_ratio;
  }
}

TEST(LinearPatch, ReferenceMaterialIsUnstableAtOneMillisecond) {
  EXPECT_LT(largest_stable_step_s(test::reference_patch(1.0)), 1e-3);
  EXPECT_EQ(largest_stable_step_s(test::reference_patch(0.0)), 0.0);
}

TEST(PaperRuns, AnUnstableStepIsRefusedWithTheLargestOne) {
  const LinearPatch patch = test::reference_patch(1.0);
  const auto path = plant::TipPath::minimum_jerk({{0, {0.02, 0.02, 0.06}}});
  const std::string message = host::test::message_of<std::invalid_argument>([&] {
    run_paper(patch, {}, path, {0.01, 1e-3}, 1);
  });
  EXPECT_NE(message.find("step of the paper's contact"), std::string::npos) << message;
  EXPECT_NE(message.find("0.001, allowed"), std::string::npos) << message;
  EXPECT_NO_THROW(run_paper(patch, {}, path, {0.01, 1e-3}, 4));
  EXPECT_THROW(run_paper(patch, {}, path, {0.01, 1e-3}, 0), std::invalid_argument);
  EXPECT_THROW(run_paper(patch, {}, path, {0.0, 1e-3}, 4), std::invalid_argument);
}

// A whole run of the shared code on the paper's patch is that of the matrices.
TEST(PaperRuns, ARunIsThatOfTheMatrices) {
  const LinearPatch patch = test::reference_patch(1.0, {3, 3, 2});
  const auto path = plant::TipPath::minimum_jerk(
      {{0, {0.0235, 0.0215, 0.0502}}, {0.02, {0.0235, 0.0215, 0.049}}, {0.04, {0.0245, 0.0218, 0.049}}});
  const PaperLaw<double> law{PaperFriction::coulomb, 0.3, PaperPointVelocity::held};
  constexpr double kStep_s = 0.25e-3;
  constexpr int kSteps = 160;
  const auto samples = run_paper(patch, law, path, {kSteps * kStep_s, kStep_s});
  PaperReference reference(patch, law);
  const auto at = [&](int i) -> Eigen::Vector3d {
    const Vec3d p = path.at(i * kStep_s).position_m;
    return {p.x, p.y, p.z};
  };
  int stick = 0, slip = 0;
  for (int i = 0; i < kSteps; ++i) {
    reference.step({at(i), at(i + 1), kStep_s});
    const ForceSample& sample = samples[static_cast<std::size_t>(i)];
    ASSERT_EQ(sample.mode, reference.contact().mode) << i;
    stick += sample.mode == ContactMode::stick;
    slip += sample.mode == ContactMode::slip;
    // Rounding of each of the steps so far, amplified by the stiffness of some 1 kN/m: forces are about 1 N.
    EXPECT_LT(norm(sample.force_N - reference.contact().instrument_force_N), 1e-10) << i;
  }
  EXPECT_GT(stick, 20);
  EXPECT_GT(slip, 20);
}

}  // namespace
}  // namespace palpate::host::paper
