#include "host/msd/semi_implicit_euler.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <stdexcept>
#include <string>

#include "host/msd/energy.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

using test::message_of;

constexpr double kStep_s = 1e-4;

TEST(SemiImplicitEuler, RefusesAnUnstableStepNamingItAndTheBound) {
  const Body body = make_lattice(test::reference_spec(12));
  SemiImplicitEuler method(body);
  BodyState state = body.rest_state();
  const std::string message = message_of<std::invalid_argument>([&] { method.step(state, {}, 1e-3); });
  EXPECT_NE(message.find("step_s is 0.001"), std::string::npos) << message;
  EXPECT_NE(message.find("0.000250966"), std::string::npos) << message;
  EXPECT_NO_THROW(method.step(state, {}, method.largest_step_s()));
}

TEST(SemiImplicitEuler, RefusesBadInput) {
  const Body body = make_lattice(test::reference_spec(3));
  SemiImplicitEuler method(body);
  BodyState state = body.rest_state();
  for (const double step_s : {0.0, -1e-4, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(method.step(state, {}, step_s), std::invalid_argument);
  const NodalForce nowhere{body.node_count(), {0, 0, 1}};
  EXPECT_THROW(method.step(state, {&nowhere, 1}, kStep_s), std::invalid_argument);
  const NodalForce not_finite{0, {0, std::numeric_limits<double>::infinity(), 0}};
  EXPECT_THROW(method.step(state, {&not_finite, 1}, kStep_s), std::invalid_argument);
  state.position_m(0, 20) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(method.step(state, {}, kStep_s), std::runtime_error);
}

// Contact relies on it: the end position of a node of mass m answers by h^2 / m to a force over the step.
TEST(SemiImplicitEuler, ImpulsesBetweenPredictAndFinishAreForces) {
  const Body body = make_lattice(test::reference_spec(4));
  const int node = body.lattice()->node(2, 1, 3);
  const BodyState start = test::random_state(body, 1, 0.001, 0.1);
  SemiImplicitEuler method(body);
  const NodalForce push{node, {0.3, -0.2, -1.0}};

  BodyState with_force = start;
  method.step(with_force, {&push, 1}, kStep_s);
  BodyState with_impulse = start;
  method.predict(with_impulse, {}, kStep_s);
  with_impulse.velocity_m_s.col(node) += kStep_s / body.mass_kg(node) * to_eigen(push.force_N);
  method.finish(with_impulse, kStep_s);
  EXPECT_LT((with_force.position_m - with_impulse.position_m).norm(), 1e-16);

  BodyState without = start;
  method.step(without, {}, kStep_s);
  const Eigen::Matrix3Xd change_m = with_force.position_m - without.position_m;
  const Eigen::Vector3d expected_m = kStep_s * kStep_s / body.mass_kg(node) * to_eigen(push.force_N);
  EXPECT_LT((change_m.col(node) - expected_m).norm(), 1e-16);
  EXPECT_LT(change_m.norm() - expected_m.norm(), 1e-16);  // no other node moves within the step
}

TEST(SemiImplicitEuler, FixedNodesDoNotMove) {
  LatticeSpec spec = test::reference_spec(4);
  spec.gravity_m_s2.z = -9.81;
  const Body body = make_lattice(spec);
  SemiImplicitEuler method(body);
  BodyState state = body.rest_state();
  state.velocity_m_s.setConstant(0.1);
  const NodalForce on_fixed{0, {1, 1, 1}};
  for (int i = 0; i < 100; ++i) method.step(state, {&on_fixed, 1}, kStep_s);
  for (int node = 0; node < body.node_count(); ++node)
    if (body.fixed(node)) {
      EXPECT_EQ(state.position_m.col(node), body.rest_position_m().col(node));
    }
  EXPECT_GT((state.position_m - body.rest_position_m()).norm(), 1e-4);
}

TEST(SemiImplicitEuler, PlanarBodiesIgnoreForcesOutOfPlane) {
  const Body body = make_lattice(test::planar_spec(4));
  SemiImplicitEuler method(body);
  BodyState state = body.rest_state();
  const NodalForce push{body.node_count() - 1, {0.1, 5.0, 0.1}};
  for (int i = 0; i < 50; ++i) method.step(state, {&push, 1}, kStep_s);
  EXPECT_EQ((state.position_m - body.rest_position_m()).row(1).norm(), 0.0);
  EXPECT_GT((state.position_m - body.rest_position_m()).row(0).norm(), 1e-5);
}

TEST(SemiImplicitEuler, FreeLatticeKeepsLinearAndAngularMomentum) {
  const Body body = make_lattice(test::free_spec(4, 0.5));
  SemiImplicitEuler method(body);
  BodyState state = test::random_state(body, 2, 0.002, 0.3);
  const auto momentum = [&](const BodyState& s) {
    Eigen::Matrix<double, 6, 1> p = Eigen::Matrix<double, 6, 1>::Zero();
    for (int node = 0; node < body.node_count(); ++node) {
      const Eigen::Vector3d mv = body.mass_kg(node) * s.velocity_m_s.col(node);
      p.head<3>() += mv;
      p.tail<3>() += Eigen::Vector3d(s.position_m.col(node)).cross(mv);
    }
    return p;
  };
  const auto before = momentum(state);
  for (int i = 0; i < 2000; ++i) method.step(state, {}, kStep_s);
  // Both are kept exactly by the method; 2,000 steps of rounding remain.
  EXPECT_LT((momentum(state) - before).norm(), 1e-12 * before.norm());
  EXPECT_GT(before.norm(), 1e-4);
}

TEST(SemiImplicitEuler, EnergyStaysWithoutDampingAndFallsWithIt) {
  constexpr double kOscillation =
      0.2;  // of the energy within an oscillation: order h omega, at 0.1 ms and 1,300 rad/s
  for (const double ratio : {0.0, 0.5}) {
    const Body body = make_lattice(test::reference_spec(4, ratio));
    SemiImplicitEuler method(body);
    BodyState state = test::random_state(body, 3, 0.001, 0.1);
    const auto energy_J = [&] { return potential_energy_J(body, state) + kinetic_energy_J(body, state); };
    const double start_J = energy_J();
    for (int i = 0; i < 10000; ++i) method.step(state, {}, kStep_s);
    if (ratio == 0.0) {
      EXPECT_NEAR(energy_J(), start_J, kOscillation * start_J);
    } else {
      EXPECT_LT(energy_J(), 1e-3 * start_J);
    }
  }
}

}  // namespace
}  // namespace palpate::host
