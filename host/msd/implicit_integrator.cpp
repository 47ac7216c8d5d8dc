#include "host/msd/implicit_integrator.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "host/msd/step_input.hpp"

namespace palpate::host {
namespace {

constexpr int kMaxNewtonIterations = 60;
// Each Newton step is solved this far; more would be lost to the change of the matrix.
constexpr double kLinearReduction = 0.03;
constexpr int kMaxHalvings = 12;
// A trial is accepted where it shrinks the residual by at least this part of what the linear model promises.
constexpr double kSufficientDecrease = 1e-4;

}  // namespace

ImplicitIntegrator::ImplicitIntegrator(const Body& body, ImplicitScheme scheme, double velocity_tolerance_m_s)
    : body_(body),
      scheme_(scheme),
      velocity_tolerance_m_s_(velocity_tolerance_m_s),
      forces_(body),
      matrix_(body),
      inverse_mass_1_kg_(palpate::host::inverse_mass_1_kg(body)) {
  if (!(velocity_tolerance_m_s > 0) || !std::isfinite(velocity_tolerance_m_s))
    throw std::invalid_argument("velocity_tolerance_m_s is " + std::to_string(velocity_tolerance_m_s) +
                                ", allowed: positive and finite");
}

void ImplicitIntegrator::step(BodyState& state, std::span<const NodalForce> external, double step_s) {
  require_step(step_s);
  external_N_.setZero(body_.node_count(), 3);
  add_external(external, external_N_);

  NodalArray position_m = state.position_m.transpose();
  NodalArray velocity_m_s = state.velocity_m_s.transpose();
  velocity_m_s.array() *= (inverse_mass_1_kg_.array() > 0).cast<double>();
  const NodalArray start_m_s = velocity_m_s;
  if (scheme_ == ImplicitScheme::euler) {
    solve_stage(position_m, velocity_m_s, start_m_s, step_s);
  } else {
    const double gamma = 1.0 - std::sqrt(0.5);
    const NodalArray start_m = position_m;
    solve_stage(position_m, velocity_m_s, start_m_s, gamma * step_s);
    const NodalArray first_m_s = velocity_m_s;
    position_m = start_m + (1.0 - gamma) * step_s * first_m_s;
    velocity_m_s = start_m_s + ((1.0 - gamma) / gamma) * (first_m_s - start_m_s);
    solve_stage(position_m, velocity_m_s, first_m_s, gamma * step_s);
  }
  state.position_m = position_m.transpose();
  state.velocity_m_s = velocity_m_s.transpose();
}

double ImplicitIntegrator::residual(const NodalArray& start_m, const NodalArray& start_m_s,
                                    const NodalArray& trial_m_s, double stage_step_s,
                                    NodalArray& residual_m_s) {
  trial_position_m_ = start_m + stage_step_s * trial_m_s;
  forces_.evaluate(trial_position_m_, trial_m_s, force_N_);
  force_N_ += external_N_;
  residual_m_s = trial_m_s - start_m_s - stage_step_s * inverse_mass_1_kg_.cwiseProduct(force_N_);
  // Squared norm in kinetic-energy units: R' M^-1 R.
  double squared = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    for (Eigen::Index node = 0; node < residual_m_s.rows(); ++node)
      squared += residual_m_s(node, axis) * residual_m_s(node, axis) * body_.mass_kg(static_cast<int>(node));
  return squared;
}

void ImplicitIntegrator::solve_stage(NodalArray& position_m, NodalArray& velocity_m_s,
                                     const NodalArray& guess_m_s, double stage_step_s) {
  NodalArray trial_m_s = guess_m_s;
  NodalArray residual_m_s;
  NodalArray next_residual_m_s;
  NodalArray next_m_s;
  NodalArray step_m_s;
  NodalArray impulse;
  double squared = residual(position_m, velocity_m_s, trial_m_s, stage_step_s, residual_m_s);
  bool only_stretched = false;
  const auto converged = [&] { return residual_m_s.cwiseAbs().maxCoeff() <= velocity_tolerance_m_s_; };
  const auto finish = [&] {
    position_m += stage_step_s * trial_m_s;
    velocity_m_s = trial_m_s;
  };
  for (int iteration = 0; iteration < kMaxNewtonIterations; ++iteration) {
    // At least one Newton step, even where the guess meets the tolerance: a body near rest would otherwise
    // creep on with the velocity it has.
    if (iteration > 0 && converged()) return finish();
    impulse = residual_m_s;
    for (Eigen::Index node = 0; node < impulse.rows(); ++node)
      impulse.row(node) *= -body_.mass_kg(static_cast<int>(node));
    matrix_.linearize(trial_position_m_, trial_m_s, stage_step_s, only_stretched);
    bool solved = matrix_.solve(impulse, kLinearReduction, step_m_s);
    double length = 1.0;
    bool accepted = false;
    for (int halving = 0; solved && !accepted && halving <= kMaxHalvings; ++halving, length *= 0.5) {
      next_m_s = trial_m_s + length * step_m_s;
      const double next = residual(position_m, velocity_m_s, next_m_s, stage_step_s, next_residual_m_s);
      accepted = next <= (1.0 - kSufficientDecrease * length) * squared;
      if (accepted) squared = next;
    }
    if (!accepted && converged()) return finish();  // rounding is all that is left
    if (accepted) {
      trial_m_s.swap(next_m_s);
      residual_m_s.swap(next_residual_m_s);
      only_stretched = false;
    } else if (!only_stretched) {
      // Compressed springs made the matrix indefinite or its step useless: try again without their geometric
      // part.
      only_stretched = true;
      residual(position_m, velocity_m_s, trial_m_s, stage_step_s, residual_m_s);
    } else {
      break;
    }
  }
  std::ostringstream message;
  message << "an implicit stage of " << stage_step_s << " s did not converge: residual "
          << residual_m_s.cwiseAbs().maxCoeff() << " m/s, allowed: at most " << velocity_tolerance_m_s_
          << "; a smaller step helps";
  throw std::runtime_error(message.str());
}

}  // namespace palpate::host
