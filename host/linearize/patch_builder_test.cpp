#include "host/linearize/patch_builder.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>

#include "host/msd/forces.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kTick_s = 1e-3;
constexpr PatchSize kPaper{4, 4, 2};

SurfacePoint top_centre(const Body& body, const BodyState& state) {
  const Eigen::Vector3d middle_m =
      0.5 * (state.position_m.rowwise().minCoeff() + state.position_m.rowwise().maxCoeff());
  return nearest_surface_point(body, state.position_m, {middle_m.x(), middle_m.y(), 1.0});
}

void step(LocalModel& model, const Eigen::VectorXd& surface_force_N) {
  const Eigen::VectorXd u = model.load + model.basis.transpose() * surface_force_N;
  for (Eigen::Index m = 0; m < model.modes(); ++m) {
    const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
    const double q = model.q[m];
    const double p = model.p[m];
    model.q[m] += c.a11 * q + c.a12 * p + c.b1 * u[m];
    model.p[m] += c.a21 * q + c.a22 * p + c.b2 * u[m];
  }
}

// The patch's own second-order system, over its degrees of freedom, and which of them the surface nodes are.
struct PatchSystem {
  SubsetTangent tangent;
  Eigen::MatrixXd surface;  // surface rows x degrees of freedom: 1 where they are the same
};

PatchSystem patch_system(const Body& body, const BodyState& state, const SurfacePoint& contact,
                         const LocalModel& model) {
  PatchSystem system{subset_tangent(body, state, select_patch(body, contact, kPaper)), {}};
  system.surface = Eigen::MatrixXd::Zero(model.basis.rows(), model.modes());
  for (Eigen::Index d = 0; d < model.modes(); ++d) {
    const auto at = static_cast<std::size_t>(d);
    const auto found = std::find(model.node.begin(), model.node.end(), system.tangent.node[at]);
    if (found != model.node.end())
      system.surface(3 * (found - model.node.begin()) + system.tangent.axis[at], d) = 1;
  }
  return system;
}

TEST(PatchBuilder, DescribesThePatchOfThePaper) {
  const Body body = make_lattice(test::reference_spec(8));
  BodyState state = test::random_state(body, 1, 0.001, 0.1);
  const SurfacePoint contact = top_centre(body, state);
  const LocalModel model = build_patch(body, state, contact, kPaper, kTick_s);
  EXPECT_EQ(model.modes(), 96);
  EXPECT_EQ(model.node.size(), 16U);
  EXPECT_EQ(model.triangle.size(), 18U);
  EXPECT_EQ(model.coefficient.size(), 96U);
  EXPECT_EQ(model.basis.rows(), 48);
  EXPECT_EQ(model.q.norm(), 0.0);
  EXPECT_LT(model.position_m.rowwise().sum().norm(), 1e-15);
  for (std::size_t n = 0; n < model.node.size(); ++n) {
    const auto column = static_cast<Eigen::Index>(n);
    const Eigen::Vector3d position_m = model.origin_m + model.position_m.col(column);
    EXPECT_LT((position_m - state.position_m.col(model.node[n])).norm(), 1e-16);
    // p is the modal image of the velocities, and the basis is complete: it gives them back.
    const Eigen::Vector3d velocity_m_s = model.basis.middleRows(3 * column, 3) * model.p;
    EXPECT_LT((velocity_m_s - state.velocity_m_s.col(model.node[n])).norm(), 1e-13);
  }
}

TEST(PatchBuilder, StaticComplianceIsThatOfADirectSolve) {
  for (const bool layered : {false, true}) {
    const LatticeSpec plain = test::reference_spec(8);
    const Body body = make_lattice(layered ? test::layered_spec(plain) : plain);
    const BodyState rest = body.rest_state();
    const SurfacePoint contact = top_centre(body, rest);
    const LocalModel model = build_patch(body, rest, contact, kPaper, kTick_s);
    const PatchSystem system = patch_system(body, rest, contact, model);
    const Eigen::MatrixXd direct =
        system.surface * (-system.tangent.df_dx_N_m).ldlt().solve(system.surface.transpose());
    const Eigen::MatrixXd modal =
        model.basis * model.lambda_rad2_s2.cwiseInverse().asDiagonal() * model.basis.transpose();
    EXPECT_LT((modal - direct).norm(), 1e-12 * direct.norm());
    EXPECT_LT(model.load.norm(),
              1e-11);  // nothing pulls at rest but rounding: 1e-14 N, by 1 / sqrt(1 g), of 96 modes
    if (layered)       // each material has a damping ratio of its own
      EXPECT_GT(model.damping_coupling, 0.01);
    else
      EXPECT_LT(model.damping_coupling, 1e-12);
    EXPECT_LT(model.stiffness_asymmetry, 1e-15);
  }
}

// At rest the damping is proportional, so that the modes are exact: against the exponential of the whole
// first-order system [x; v] with a force held over each tick.
TEST(PatchBuilder, ModalStepsAreTheMatrixExponential) {
  const Body body = make_lattice(test::reference_spec(8, 0.4));
  const BodyState rest = body.rest_state();
  const SurfacePoint contact = top_centre(body, rest);
  LocalModel model = build_patch(body, rest, contact, kPaper, kTick_s);
  ASSERT_LT(model.lambda_rad2_s2.maxCoeff() * kTick_s * kTick_s,
            kLargestResolvedPhase_rad * kLargestResolvedPhase_rad);
  const PatchSystem system = patch_system(body, rest, contact, model);

  const Eigen::Index n = model.modes();
  const Eigen::MatrixXd inverse_mass = system.tangent.mass_kg.cwiseInverse().asDiagonal();
  Eigen::MatrixXd generator = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  generator.topRightCorner(n, n).setIdentity();
  generator.bottomLeftCorner(n, n) = inverse_mass * system.tangent.df_dx_N_m;
  generator.bottomRightCorner(n, n) = inverse_mass * system.tangent.df_dv_N_s_m;
  const Eigen::MatrixXd scaled = generator * kTick_s;
  const Eigen::MatrixXd a = scaled.exp();
  // Held force: z+ = A z + (A - I) G^-1 [0; M^-1 f].
  const Eigen::MatrixXd from_force =
      generator.partialPivLu().solve(a - Eigen::MatrixXd::Identity(2 * n, 2 * n)).rightCols(n) *
      inverse_mass * system.surface.transpose();

  Eigen::VectorXd z = Eigen::VectorXd::Zero(2 * n);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  double largest_m = 0;
  for (int tick = 0; tick < 50; ++tick) {
    Eigen::VectorXd force_N(model.basis.rows());
    for (double& component : force_N) component = uniform(random);
    step(model, force_N);
    z = (a * z + from_force * force_N).eval();
    const Eigen::VectorXd exact_m = system.surface * z.head(n);
    largest_m = std::max(largest_m, exact_m.cwiseAbs().maxCoeff());
    EXPECT_LT((model.basis * model.q - exact_m).cwiseAbs().maxCoeff(), 1e-12 * (largest_m + 1e-3));
  }
  EXPECT_GT(largest_m, 1e-4);
}

TEST(PatchBuilder, StartsWithTheAccelerationOfTheNonlinearBody) {
  for (LatticeSpec spec : {test::reference_spec(8), test::layered_spec(test::reference_spec(8))}) {
    spec.gravity_m_s2.z = -9.81;
    const Body body = make_lattice(spec);
    const BodyState state = test::random_state(body, 2, 0.002, 0.3);
    const LocalModel model = build_patch(body, state, top_centre(body, state), kPaper, kTick_s);
    EXPECT_GT(model.damping_coupling, 0.01);
    EXPECT_GT(model.stiffness_asymmetry, 0.01);
    const Eigen::VectorXd acceleration =
        model.basis * (model.load - model.damping_rad_s.cwiseProduct(model.p));
    for (std::size_t n = 0; n < model.node.size(); ++n) {
      const Eigen::Vector3d exact = nodal_force_N(body, state, model.node[n]) / body.mass_kg(model.node[n]);
      EXPECT_LT((acceleration.segment<3>(3 * static_cast<Eigen::Index>(n)) - exact).norm(),
                1e-11 * exact.norm());
    }
  }
}

// Against the non-linear patch itself, everything outside fixed: the error of the linearization falls with
// the square of the disturbance. Of three materials with damping in proportion to stiffness: other damping is
// what the modes leave out (damping_coupling).
TEST(PatchBuilder, FollowsTheNonlinearPatch) {
  LatticeSpec spec = test::layered_spec(test::reference_spec(7, 0.5));
  for (MaterialRegion& region : spec.regions)
    region.damping_N_s_m = spec.damping_N_s_m / spec.stiffness_N_m * region.stiffness_N_m;
  const Body whole = make_lattice(spec);
  const SurfacePoint contact = top_centre(whole, whole.rest_state());
  const std::vector<int> nodes = select_patch(whole, contact, kPaper);
  BodyDescription description;
  for (int node = 0; node < whole.node_count(); ++node) {
    description.mass_kg.push_back(whole.mass_kg(node));
    description.fixed.push_back(!std::binary_search(nodes.begin(), nodes.end(), node));
  }
  description.rest_position_m = whole.rest_position_m();
  description.springs = whole.springs();
  description.triangles = whole.triangles();
  description.lattice = whole.lattice();
  const Body patch(description);

  std::vector<double> errors_m;
  for (const double amplitude : {1.0, 0.5}) {
    BodyState state = test::random_state(patch, 3, 1e-4 * amplitude, 0.02 * amplitude);
    LocalModel model = build_patch(whole, state, contact, kPaper, kTick_s);
    SemiImplicitEuler method(patch);
    constexpr int kSubsteps = 500;
    constexpr int kTicks = 5;
    Eigen::VectorXd force_N = Eigen::VectorXd::Zero(model.basis.rows());
    force_N[2] = -0.05 * amplitude;
    const NodalForce push{model.node[0], {0, 0, force_N[2]}};
    for (int tick = 0; tick < kTicks; ++tick) {
      step(model, force_N);
      for (int s = 0; s < kSubsteps; ++s) method.step(state, {&push, 1}, kTick_s / kSubsteps);
    }
    double error_m = 0;
    double largest_m = 0;
    const Eigen::VectorXd displacement_m = model.basis * model.q;
    for (std::size_t n = 0; n < model.node.size(); ++n) {
      const auto column = static_cast<Eigen::Index>(n);
      const Eigen::Vector3d modelled_m =
          model.origin_m + model.position_m.col(column) + displacement_m.segment<3>(3 * column);
      error_m = std::max(error_m, (modelled_m - state.position_m.col(model.node[n])).norm());
      largest_m = std::max(largest_m, displacement_m.segment<3>(3 * column).norm());
    }
    EXPECT_LT(error_m, 0.05 * largest_m);
    errors_m.push_back(error_m);
  }
  const double order = std::log2(errors_m[0] / errors_m[1]);
  EXPECT_NEAR(order, 2.0, 0.3) << errors_m[0] << " " << errors_m[1];
}

TEST(PatchBuilder, FixedNodesAreGeometryWithoutMotion) {
  LatticeSpec spec = test::reference_spec(6);
  spec.fixed_faces = {Face::x_minus};
  const Body body = make_lattice(spec);
  const BodyState rest = body.rest_state();
  const SurfacePoint contact = nearest_surface_point(body, rest.position_m, {0.005, 0.025, 0.06});
  const LocalModel model = build_patch(body, rest, contact, kPaper, kTick_s);
  EXPECT_EQ(model.modes(), 3 * (32 - 8));
  int fixed = 0;
  for (std::size_t n = 0; n < model.node.size(); ++n) {
    const double rows = model.basis.middleRows(3 * static_cast<Eigen::Index>(n), 3).norm();
    if (body.fixed(model.node[n])) {
      EXPECT_EQ(rows, 0.0);
      ++fixed;
    } else {
      EXPECT_GT(rows, 1.0);
    }
  }
  EXPECT_EQ(fixed, 8);
}

TEST(PatchBuilder, RigidPatchHasNoModes) {
  LatticeSpec spec = test::reference_spec(6);
  spec.fixed_faces.clear();
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      for (int k = 4; k < 6; ++k) spec.fixed_nodes.push_back({i, j, k});
  const Body body = make_lattice(spec);
  const LocalModel model =
      build_patch(body, body.rest_state(), top_centre(body, body.rest_state()), kPaper, kTick_s);
  EXPECT_EQ(model.modes(), 0);
  EXPECT_EQ(model.node.size(), 16U);
  EXPECT_EQ(model.triangle.size(), 18U);
}

TEST(PatchBuilder, KeepsToTheCapacity) {
  const Body body = make_lattice(test::reference_spec(8));
  const BodyState rest = body.rest_state();
  const LocalModel centre = build_patch(body, rest, top_centre(body, rest), {4, 4, 4}, kTick_s);
  EXPECT_EQ(centre.modes(), 192);
  EXPECT_EQ(centre.node.size(), 16U);
  EXPECT_LE(static_cast<std::size_t>(centre.basis.size()), kMaxBasis);

  const SurfacePoint corner = nearest_surface_point(body, rest.position_m, {0.07, 0.07, 0.07});
  const LocalModel at_corner = build_patch(body, rest, corner, {4, 4, 4}, kTick_s);
  EXPECT_EQ(at_corner.modes(), 192);
  EXPECT_LE(static_cast<std::size_t>(at_corner.basis.size()), kMaxBasis);
  EXPECT_NE(std::find(at_corner.triangle.begin(), at_corner.triangle.end(), corner.triangle),
            at_corner.triangle.end());

  const std::string message = test::message_of<std::invalid_argument>([&] {
    build_patch(body, rest, top_centre(body, rest), {5, 4, 4}, kTick_s);
  });
  EXPECT_NE(message.find("240 modes, allowed: at most 192"), std::string::npos) << message;
}

}  // namespace
}  // namespace palpate::host
