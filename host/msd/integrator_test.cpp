#include "host/msd/integrator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "host/msd/forces.hpp"
#include "host/msd/implicit_integrator.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kDuration_s = 0.02;

// Classical Runge-Kutta of order 4: another scheme than those under test, far more accurate at the step it is
// used at.
BodyState reference_solution(const Body& body, BodyState state, const NodalForce& push) {
  constexpr double kStep_s = 2e-5;
  ForceEvaluator evaluator(body);
  const auto acceleration = [&](const BodyState& at) {
    Eigen::Matrix3Xd a;
    evaluator.evaluate(at, a);
    a.col(push.node) += to_eigen(push.force_N);
    for (int node = 0; node < body.node_count(); ++node)
      body.fixed(node) ? a.col(node).setZero() : a.col(node) /= body.mass_kg(node);
    return a;
  };
  const auto advanced = [&](const BodyState& slope, double h) {
    return BodyState{state.position_m + h * slope.position_m, state.velocity_m_s + h * slope.velocity_m_s};
  };
  const auto slope_at = [&](const BodyState& at) { return BodyState{at.velocity_m_s, acceleration(at)}; };
  for (int i = 0; i < static_cast<int>(std::lround(kDuration_s / kStep_s)); ++i) {
    const BodyState k1 = slope_at(state);
    const BodyState k2 = slope_at(advanced(k1, 0.5 * kStep_s));
    const BodyState k3 = slope_at(advanced(k2, 0.5 * kStep_s));
    const BodyState k4 = slope_at(advanced(k3, kStep_s));
    state.position_m += kStep_s / 6 * (k1.position_m + 2 * k2.position_m + 2 * k3.position_m + k4.position_m);
    state.velocity_m_s +=
        kStep_s / 6 * (k1.velocity_m_s + 2 * k2.velocity_m_s + 2 * k3.velocity_m_s + k4.velocity_m_s);
  }
  return state;
}

struct Case {
  const char* name;
  std::unique_ptr<Integrator> method;
  int order;
};

TEST(Integrators, ConvergeWithTheirOrder) {
  constexpr double kOrderTolerance = 0.1;  // the next term of the error is still visible at these steps
  LatticeSpec spec = test::reference_spec(3, 0.2);
  spec.gravity_m_s2.z = -9.81;
  const Body body = make_lattice(spec);
  // A smooth start: the highest modes, which 0.2 ms does not resolve, are not excited.
  BodyState start = body.rest_state();
  for (int node = 0; node < body.node_count(); ++node) {
    const double height_m = body.rest_position_m()(2, node);
    start.position_m.col(node) += Eigen::Vector3d(4.0, 2.0, -3.0) * height_m * height_m;
    start.velocity_m_s.col(node) = Eigen::Vector3d(5.0, -3.0, 8.0) * height_m;
  }
  const NodalForce push{body.lattice()->node(1, 1, 2), {0.1, 0.05, -0.3}};
  const BodyState exact = reference_solution(body, start, push);

  constexpr double kTight_m_s = 1e-12;  // far below the errors of the steps
  std::vector<Case> cases;
  cases.push_back({"semi-implicit Euler", std::make_unique<SemiImplicitEuler>(body), 1});
  cases.push_back(
      {"implicit Euler", std::make_unique<ImplicitIntegrator>(body, ImplicitScheme::euler, kTight_m_s), 1});
  cases.push_back(
      {"SDIRK2", std::make_unique<ImplicitIntegrator>(body, ImplicitScheme::sdirk2, kTight_m_s), 2});
  for (const Case& tested : cases) {
    std::vector<double> errors;
    for (const int steps : {100, 200, 400}) {
      BodyState state = start;
      for (int i = 0; i < steps; ++i) tested.method->step(state, {&push, 1}, kDuration_s / steps);
      errors.push_back((state.position_m - exact.position_m).norm());
    }
    for (std::size_t i = 0; i + 1 < errors.size(); ++i) {
      EXPECT_NEAR(std::log2(errors[i] / errors[i + 1]), tested.order, kOrderTolerance)
          << tested.name << ", errors " << errors[i] << " and " << errors[i + 1] << " m";
    }
  }
}

TEST(Integrators, AgreeOnTheEquilibrium) {
  LatticeSpec spec = test::reference_spec(4);
  spec.gravity_m_s2 = {0.5, 0, -9.81};
  const Body body = make_lattice(spec);
  const NodalForce push{body.lattice()->node(1, 2, 3), {0.2, 0.1, -0.6}};
  std::vector<BodyState> ends;
  for (const Method method : {Method::semi_implicit_euler, Method::implicit_euler, Method::sdirk2}) {
    std::unique_ptr<Integrator> integrator = make_integrator(method, body);
    BodyState state = body.rest_state();
    // 1.2 s either way; the velocities left are checked below.
    const bool is_explicit = method == Method::semi_implicit_euler;
    const double step_s = is_explicit ? 2e-4 : 10e-3;
    for (int i = 0; i < (is_explicit ? 6000 : 120); ++i) integrator->step(state, {&push, 1}, step_s);
    ends.push_back(state);
  }
  for (const BodyState& end : ends) EXPECT_LT((end.position_m - ends[0].position_m).norm(), 1e-8);
  EXPECT_LT(ends[0].velocity_m_s.norm(), 1e-8);
}

}  // namespace
}  // namespace palpate::host
