// Semi-implicit (symplectic) Euler: V+ = V + h M^-1 f(X, V), X+ = X + h V+. Order 1, one force evaluation a
// step.
#pragma once

#include <Eigen/Core>
#include <span>

#include "host/msd/body.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/integrator.hpp"
#include "host/msd/vectors.hpp"

namespace palpate::host {

// A step is `predict`, then whatever contact or guidance changes velocities, then `finish`:
// - an impulse J on a node of mass m between the two changes its velocity by J / m, and its position at the
// end of the
//   step by exactly (h / m) J; a force F over the step is J = h F, so the end position answers by h^2 / m to
//   a force;
// - a node that is to be at a given place at the end of the step gets the velocity that leads there; the
// force that
//   this takes is m (given - predicted velocity) / h.
class SemiImplicitEuler final : public Integrator {
 public:
  explicit SemiImplicitEuler(const Body& body);

  void step(BodyState& state, std::span<const NodalForce> external, double step_s) override;

  // Sets velocities to those at the end of the step without contact: V + h M^-1 (f(X, V) + external); fixed
  // nodes zero. Positions stay. Throws std::invalid_argument for an unstable step, naming it and the bound.
  void predict(BodyState& state, std::span<const NodalForce> external, double step_s);

  // Moves positions by h times the velocities. Throws std::runtime_error where the motion has ceased to be
  // finite.
  void finish(BodyState& state, double step_s) const;

  // The bound that steps are held to: stable_step_s at the rest position.
  [[nodiscard]] double largest_step_s() const { return largest_step_s_; }

 private:
  const Body& body_;
  ForceEvaluator forces_;
  Eigen::Matrix3Xd inverse_mass_1_kg_;
  double largest_step_s_;
  NodalArray position_m_;
  NodalArray velocity_m_s_;
  NodalArray force_N_;
};

}  // namespace palpate::host
