#include "host/msd/implicit_integrator.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "host/msd/energy.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

TEST(ImplicitIntegrator, SolvesTheEquationOfImplicitEuler) {
  constexpr double kTight_m_s = 1e-11;
  for (const double step_s : {1e-3, 33e-3}) {
    const Body body = make_lattice(test::reference_spec(5, 0.6));
    const BodyState start = test::random_state(body, 1, 0.002, 0.3);
    BodyState end = start;
    ImplicitIntegrator method(body, ImplicitScheme::euler, kTight_m_s);
    const NodalForce push{body.lattice()->node(2, 2, 4), {0.2, 0.1, -0.5}};
    method.step(end, {&push, 1}, step_s);
    EXPECT_LT((end.position_m - start.position_m - step_s * end.velocity_m_s).norm(), 1e-15);
    Eigen::Matrix3Xd force_N;
    ForceEvaluator(body).evaluate(end, force_N);
    force_N.col(push.node) += to_eigen(push.force_N);
    for (int node = 0; node < body.node_count(); ++node) {
      const Eigen::Vector3d change_m_s = end.velocity_m_s.col(node) - start.velocity_m_s.col(node);
      const Eigen::Vector3d expected_m_s = step_s / body.mass_kg(node) * force_N.col(node);
      // The residual is computed twice in different order: rounding of forces of newtons on a gram.
      if (!body.fixed(node)) {
        EXPECT_LT((change_m_s - expected_m_s).norm(), 2 * kTight_m_s + 1e-10);
      }
    }
  }
}

// 33 ms on a material ten thousand times stiffer than the reference, poked and let go: must settle at rest.
TEST(ImplicitIntegrator, StaysStableAtLargeStepsAndStiffMaterial) {
  LatticeSpec spec = test::reference_spec(6);
  spec.stiffness_N_m = 1e6;
  spec.damping_N_s_m = damping_from_ratio(0.1, spec.mass_kg, spec.stiffness_N_m);
  const Body body = make_lattice(spec);
  const int node = body.lattice()->node(3, 3, 5);
  for (const ImplicitScheme scheme : {ImplicitScheme::euler, ImplicitScheme::sdirk2}) {
    ImplicitIntegrator method(body, scheme);
    BodyState state = body.rest_state();
    const NodalForce push{node, {0, 0, -2000.0}};
    for (int i = 0; i < 30; ++i) method.step(state, {&push, 1}, 33e-3);
    Eigen::Matrix3Xd force_N;
    ForceEvaluator(body).evaluate(state, force_N);
    EXPECT_NEAR(force_N(2, node), 2000.0, 1e-3);  // static equilibrium
    const double pressed_J = potential_energy_J(body, state) + kinetic_energy_J(body, state);
    double energy_J = pressed_J;
    for (int i = 0; i < 30; ++i) {
      method.step(state, {}, 33e-3);
      const double now_J = potential_energy_J(body, state) + kinetic_energy_J(body, state);
      if (scheme == ImplicitScheme::euler) {
        EXPECT_LE(now_J, energy_J + 1e-12);
      }
      energy_J = now_J;
    }
    EXPECT_LT(energy_J, 1e-9 * pressed_J);
  }
}

TEST(ImplicitIntegrator, FixedNodesDoNotMoveAndPlanesStay) {
  for (const LatticeSpec& spec : {test::reference_spec(4), test::planar_spec(5)}) {
    const Body body = make_lattice(spec);
    ImplicitIntegrator method(body, ImplicitScheme::sdirk2);
    BodyState state = body.rest_state();
    state.velocity_m_s.setConstant(0.1);
    const NodalForce pushes[] = {{0, {1, 1, 1}}, {body.node_count() - 1, {0.1, 0.1, 0.1}}};
    for (int i = 0; i < 10; ++i) method.step(state, pushes, 2e-3);
    for (int node = 0; node < body.node_count(); ++node)
      if (body.fixed(node)) {
        EXPECT_EQ(state.position_m.col(node), body.rest_position_m().col(node));
      }
    if (body.planar()) {
      EXPECT_EQ((state.position_m - body.rest_position_m()).row(1).norm(), 0.0);
    }
  }
}

TEST(ImplicitIntegrator, FreeLatticeKeepsItsMomentum) {
  const Body body = make_lattice(test::free_spec(4, 0.5));
  for (const ImplicitScheme scheme : {ImplicitScheme::euler, ImplicitScheme::sdirk2}) {
    ImplicitIntegrator method(body, scheme, 1e-10);
    BodyState state = test::random_state(body, 2, 0.002, 0.3);
    const Eigen::Vector3d before_m_s = state.velocity_m_s.rowwise().mean();
    for (int i = 0; i < 50; ++i) method.step(state, {}, 1e-3);
    // 50 steps (of two stages), each solved to 1e-10 m/s in every node.
    EXPECT_LT((state.velocity_m_s.rowwise().mean() - before_m_s).norm(), 1e-8);
  }
}

TEST(ImplicitIntegrator, SaysWhenItCannotSolveAStep) {
  const Body body = make_lattice(test::reference_spec(3));
  constexpr double kBelowRounding_m_s = 1e-40;
  ImplicitIntegrator method(body, ImplicitScheme::euler, kBelowRounding_m_s);
  BodyState state = test::random_state(body, 3, 0.001, 0.1);
  const std::string message = test::message_of<std::runtime_error>([&] { method.step(state, {}, 1e-3); });
  EXPECT_NE(message.find("0.001 s did not converge"), std::string::npos) << message;
  EXPECT_THROW(ImplicitIntegrator(body, ImplicitScheme::euler, 0.0), std::invalid_argument);
  EXPECT_THROW(method.step(state, {}, -1.0), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
