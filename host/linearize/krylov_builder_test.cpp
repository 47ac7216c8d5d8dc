#include "host/linearize/krylov_builder.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <numbers>
#include <stdexcept>

#include "host/linearize/body_response.hpp"
#include "host/linearize/compliance_error.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kTick_s = 1e-3;
constexpr PatchSize kPatch{4, 4, 2};
const std::vector<double> kShifts_rad_s{0.0, 2.0 * std::numbers::pi * 20.0};

SurfacePoint top_at(const Body& body, double x_m, double y_m) {
  const Eigen::Matrix3Xd& rest_m = body.rest_position_m();
  const Eigen::Vector3d middle_m = 0.5 * (rest_m.rowwise().minCoeff() + rest_m.rowwise().maxCoeff());
  return nearest_surface_point(body, rest_m, middle_m + Eigen::Vector3d(x_m, y_m, 1.0));
}

// The body after its top has been pulled and let go: bent and in motion.
BodyState moving_state(const Body& body) {
  SemiImplicitEuler integrator(body);
  BodyState state = body.rest_state();
  const int top = body.lattice()->node(3, 3, body.lattice()->nodes[2] - 1);
  state.position_m.col(top) += Eigen::Vector3d(0.001, -0.0005, -0.003);
  for (int i = 0; i < 50; ++i) integrator.step(state, {}, 1e-4);
  return state;
}

double largest_difference_m(const LocalModel& model, const BodyState& body) {
  const Eigen::VectorXd moved_m = model.basis * model.q;
  double largest_m = 0;
  for (std::size_t n = 0; n < model.node.size(); ++n) {
    const auto column = static_cast<Eigen::Index>(n);
    const Eigen::Vector3d here_m =
        model.origin_m + model.position_m.col(column) + moved_m.segment<3>(3 * column);
    largest_m = std::max(largest_m, (here_m - body.position_m.col(model.node[n])).norm());
  }
  return largest_m;
}

void step(LocalModel& model, const Eigen::VectorXd& force_N) {
  const Eigen::VectorXd u = model.load + model.basis.transpose() * force_N;
  for (Eigen::Index m = 0; m < model.modes(); ++m) {
    const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
    const double q = model.q[m], p = model.p[m];
    model.q[m] += c.a11 * q + c.a12 * p + c.b1 * u[m];
    model.p[m] += c.a21 * q + c.a22 * p + c.b2 * u[m];
  }
}

// A force of 0.2 N on a node of the top for 60 ms, from rest: how far the model's surface is from the full
// body's, both largest over time, in metres.
struct Deviation {
  double model_m = 0;
  double body_m = 0;
};
Deviation deviation_under(const Body& body, LocalModel model, int node, const Eigen::Vector3d& force_N) {
  constexpr int kStepsPerTick = 50;
  SemiImplicitEuler integrator(body);
  BodyState state = body.rest_state();
  Eigen::VectorXd on_surface_N = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(model.node.size()));
  const auto at = std::find(model.node.begin(), model.node.end(), node) - model.node.begin();
  on_surface_N.segment<3>(3 * at) = force_N;
  const std::array push{NodalForce{node, from_eigen(force_N)}};
  Deviation largest;
  for (int tick = 0; tick < 60; ++tick) {
    for (int i = 0; i < kStepsPerTick; ++i) integrator.step(state, push, kTick_s / kStepsPerTick);
    step(model, on_surface_N);
    largest.model_m = std::max(largest.model_m, largest_difference_m(model, state));
    largest.body_m =
        std::max(largest.body_m, (state.position_m - body.rest_position_m()).colwise().norm().maxCoeff());
  }
  return largest;
}

class Krylov : public testing::Test {
 protected:
  Body body_ = make_lattice(test::reference_spec(8));
};

TEST_F(Krylov, FollowsTheWholeBodyWhereThePatchCannot) {
  // 5 mN: a deflection far below a cell, so that the body is linear.
  const Eigen::Vector3d force_N(0.003, 0.0, -0.004);
  const SurfacePoint contact = top_at(body_, 0.0, 0.0);
  KrylovBuilder builder(body_, kPatch, TangentAt::rest, kShifts_rad_s, kTick_s);
  const BodyState rest = body_.rest_state();
  LocalModel whole = builder.build(rest, contact, {});
  ASSERT_EQ(whole.modes(), 96);
  const int node = whole.node[5];
  const Deviation krylov = deviation_under(body_, std::move(whole), node, force_N);
  const Deviation patch =
      deviation_under(body_, build_patch(body_, rest, contact, kPatch, kTick_s), node, force_N);
  EXPECT_LT(krylov.model_m, 0.02 * krylov.body_m);
  EXPECT_GT(patch.model_m, 5.0 * krylov.model_m);
}

TEST_F(Krylov, TheFramesTangentIsThatOfTheWholeBody) {
  // Against the tangent of all springs, in the span at rest: modes' frequencies squared are the eigenvalues
  // there. What springs that have changed by less than 3 % may add is 3 % of the stiffness.
  const BodyState state = moving_state(body_);
  const SurfacePoint contact = top_at(body_, 0.0, 0.0);
  KrylovBuilder at_rest(body_, kPatch, TangentAt::rest, {0.0}, kTick_s);
  KrylovBuilder of_frame(body_, kPatch, TangentAt::frame, {0.0}, kTick_s);
  const LocalModel rest = at_rest.build(state, contact, {});
  const LocalModel frame = of_frame.build(state, contact, {});
  const WholeBodyBasis span = WholeBodyReduction(body_, {0.0}).reduce(frame.node);
  const Tangent now = tangent(body_, state);
  const Eigen::MatrixXd stiffness =
      -span.basis_1_sqrt_kg.transpose() * (now.df_dx_N_m * span.basis_1_sqrt_kg);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> exact(0.5 * (stiffness + stiffness.transpose()));
  ASSERT_EQ(frame.modes(), exact.eigenvalues().size());
  EXPECT_LT((frame.lambda_rad2_s2 - exact.eigenvalues()).norm(), 0.03 * exact.eigenvalues().norm());
  EXPECT_LT((frame.lambda_rad2_s2 - exact.eigenvalues()).norm(),
            0.5 * (rest.lambda_rad2_s2 - exact.eigenvalues()).norm());
}

TEST_F(Krylov, StartsAsTheNonLinearBodyMoves) {
  // One tick without contact: the difference is that of the tangent and of what the modes do not span, over 1
  // ms.
  const BodyState state = moving_state(body_);
  KrylovBuilder builder(body_, kPatch, TangentAt::rest, kShifts_rad_s, kTick_s);
  LocalModel model = builder.build(state, top_at(body_, 0.0, 0.0), {});
  EXPECT_LT(largest_difference_m(model, state), 1e-15);
  BodyState later = state;
  SemiImplicitEuler integrator(body_);
  for (int i = 0; i < 100; ++i) integrator.step(later, {}, 1e-5);
  const double moved_m = (later.position_m - state.position_m).colwise().norm().maxCoeff();
  step(model, Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(model.node.size())));
  EXPECT_LT(largest_difference_m(model, later), 0.1 * moved_m);
}

TEST_F(Krylov, TheContactsCellHasItsOwnFrequencies) {
  // 84 modes: 3 for each of 16 nodes, and 12 for each frequency of the four nodes around the contact. At the
  // contact they answer as well as 144 with three frequencies for all, or better.
  const auto rad_s = [](double hertz) { return 2.0 * std::numbers::pi * hertz; };
  const BodyState rest = body_.rest_state();
  const SurfacePoint contact = top_at(body_, 0.001, 0.002);
  BodyResponse response(body_, rest, {contact});
  const std::vector<double> grid_Hz = compliance_grid_Hz(10);
  std::vector<Eigen::Matrix3cd> exact;
  for (const double hertz : grid_Hz) exact.push_back(response.compliance(rad_s(hertz))[0]);
  const auto error = [&](const Shifts& shifts, Eigen::Index modes) {
    KrylovBuilder builder(body_, kPatch, TangentAt::rest, shifts, kTick_s);
    const LocalModel model = builder.build(rest, contact, {});
    EXPECT_EQ(model.modes(), modes);
    return compliance_error(model, contact, grid_Hz, exact).largest;
  };
  const double middle = error(Shifts({0.0}, {rad_s(20.0), rad_s(40.0), rad_s(300.0)}), 84);
  EXPECT_LT(middle, 0.02);
  EXPECT_LT(middle, 0.3 * error({0.0, rad_s(20.0)}, 96));
}

TEST_F(Krylov, RemembersBases) {
  KrylovBuilder builder(body_, kPatch, TangentAt::rest, kShifts_rad_s, kTick_s);
  const BodyState rest = body_.rest_state();
  const LocalModel first = builder.build(rest, top_at(body_, 0.0, 0.0), {});
  (void)builder.build(rest, top_at(body_, 0.015, 0.0), {});
  EXPECT_EQ(builder.bases().computed, 2U);
  const LocalModel again = builder.build(rest, top_at(body_, 0.001, 0.001), {});
  EXPECT_EQ(builder.bases().computed, 2U);
  EXPECT_EQ(first.node, again.node);
  EXPECT_EQ(first.basis, again.basis);
}

TEST_F(Krylov, KeepsToTheCapacityAtEdgesAndCorners) {
  KrylovBuilder builder(body_, kPatch, TangentAt::rest, kShifts_rad_s, kTick_s);
  const LocalModelCapacity capacity;
  for (const auto& [x_m, y_m] : {std::pair{0.035, 0.0}, std::pair{0.035, 0.035}, std::pair{-0.035, 0.035}}) {
    const LocalModel model = builder.build(body_.rest_state(), top_at(body_, x_m, y_m), {});
    EXPECT_LE(model.modes(), capacity.modes);
    EXPECT_LE(model.basis.size(), capacity.basis);
    EXPECT_GE(model.node.size(), 16U);
  }
}

TEST_F(Krylov, RefusesWhatItCannot) {
  EXPECT_THROW(KrylovBuilder(body_, PatchSize{6, 6, 2}, TangentAt::rest, kShifts_rad_s, kTick_s),
               std::invalid_argument);
  KrylovBuilder builder(body_, kPatch, TangentAt::rest, kShifts_rad_s, kTick_s);
  EXPECT_THROW((void)builder.build(body_.rest_state(), top_at(body_, 0.0, 0.0), {5}), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
