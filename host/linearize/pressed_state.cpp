#include "host/linearize/pressed_state.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "host/msd/semi_implicit_euler.hpp"

namespace palpate::host {
namespace {

constexpr double kSettle_s = 1.0;

}  // namespace

BodyState pressed_state(const Body& body, int node, const Eigen::Vector3d& displacement_m, double step_s) {
  if (node < 0 || node >= body.node_count() || body.fixed(node))
    throw std::invalid_argument("node " + std::to_string(node) +
                                " can't be pressed in: it is fixed or none of the body's");
  BodyState state = body.rest_state();
  if (displacement_m.isZero(0.0)) return state;
  SemiImplicitEuler integrator(body);
  const Eigen::Vector3d held_m = state.position_m.col(node) + displacement_m;
  const auto hold = [&] {
    state.position_m.col(node) = held_m;
    state.velocity_m_s.col(node).setZero();
  };
  const long steps = std::lround(kSettle_s / step_s);
  for (long i = 0; i < steps; ++i) {
    hold();
    integrator.step(state, {}, step_s);
  }
  hold();
  if (!state.position_m.allFinite())
    throw std::invalid_argument("a step of " + std::to_string(step_s) + " s is not stable for this body");
  state.velocity_m_s.setZero();
  return state;
}

}  // namespace palpate::host
