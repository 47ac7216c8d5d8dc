#include "host/msd/semi_implicit_euler.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "host/msd/stable_step.hpp"
#include "host/msd/step_input.hpp"

namespace palpate::host {

SemiImplicitEuler::SemiImplicitEuler(const Body& body)
    : body_(body),
      forces_(body),
      inverse_mass_1_kg_(palpate::host::inverse_mass_1_kg(body).transpose()),
      largest_step_s_(stable_step_s(body, body.rest_position_m())) {}

void SemiImplicitEuler::step(BodyState& state, std::span<const NodalForce> external, double step_s) {
  predict(state, external, step_s);
  finish(state, step_s);
}

void SemiImplicitEuler::predict(BodyState& state, std::span<const NodalForce> external, double step_s) {
  require_step(step_s);
  if (step_s > largest_step_s_) {
    std::ostringstream message;
    message << "step_s is " << step_s << ", allowed: at most " << largest_step_s_
            << " (stability bound of the semi-implicit Euler method for this body)";
    throw std::invalid_argument(message.str());
  }
  position_m_ = state.position_m.transpose();
  velocity_m_s_ = state.velocity_m_s.transpose();
  forces_.evaluate(position_m_, velocity_m_s_, force_N_);
  add_external(external, force_N_);
  state.velocity_m_s.array() += step_s * inverse_mass_1_kg_.array() * force_N_.transpose().array();
  for (Eigen::Index node = 0; node < state.velocity_m_s.cols(); ++node)
    if (body_.fixed(static_cast<int>(node))) state.velocity_m_s.col(node).setZero();
  if (body_.planar()) state.velocity_m_s.row(1).setZero();
}

void SemiImplicitEuler::finish(BodyState& state, double step_s) const {
  state.position_m += step_s * state.velocity_m_s;
  // A sum is not finite as soon as one term is not: one cheap pass instead of a test per number.
  if (!std::isfinite(state.position_m.sum()))
    throw std::runtime_error(
        "the body's motion is no longer finite: the step is unstable in its deformed state");
}

}  // namespace palpate::host
