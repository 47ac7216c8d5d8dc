// Implicit methods for large steps and stiff bodies, solved by a matrix-free Newton method.
//
// A stage solves, for the velocity V at its end and with constants X*, V* and g = gamma h,
//   R(V) = M (V - V*) - g (f(X* + g V, V) + external) = 0,   X = X* + g V.
// Newton's matrix M + g D + g^2 K (implicit_matrix.hpp) is solved by conjugate gradients.
// - euler: one stage, gamma = 1, X* = X, V* = V. Order 1, L-stable, damps what the step does not resolve.
// - sdirk2: Alexander's L-stable, stiffly accurate method of order 2 (SIAM J. Numer. Anal. 14, 1977, 1006),
//   gamma = 1 - 1/sqrt(2); the second stage starts from X + (1 - gamma) h V1, V + (1 - gamma) h A1, with A1
//   the acceleration of the first stage, and its end is the step's. That start is an extrapolation: a load
//   that moves a node by a cell within one step can turn springs inside out and leave the body in an inverted
//   equilibrium (seen with 120 N put at once on one node of 12^3 at k = 1e4 N/m and 33 ms; euler was right
//   there).
#pragma once

#include <span>

#include "host/msd/body.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/implicit_matrix.hpp"
#include "host/msd/integrator.hpp"
#include "host/msd/vectors.hpp"

namespace palpate::host {

enum class ImplicitScheme { euler, sdirk2 };

// How far Newton's method goes: the largest component of M^-1 R, a velocity. It bounds the error of V in the
// norm of the kinetic energy, because the matrix is at least M where the body is stable.
inline constexpr double kDefaultVelocityTolerance_m_s = 1e-7;

class ImplicitIntegrator final : public Integrator {
 public:
  // Throws std::invalid_argument unless the tolerance is positive and finite.
  ImplicitIntegrator(const Body& body, ImplicitScheme scheme,
                     double velocity_tolerance_m_s = kDefaultVelocityTolerance_m_s);

  void step(BodyState& state, std::span<const NodalForce> external, double step_s) override;

 private:
  // Solves a stage in place: position and velocity hold X*, V* on entry and the stage's end on return;
  // `guess` is a first guess of the velocity.
  void solve_stage(NodalArray& position_m, NodalArray& velocity_m_s, const NodalArray& guess_m_s,
                   double stage_step_s);
  // M^-1 R at a trial velocity; also sets trial_position_m_.
  double residual(const NodalArray& start_m, const NodalArray& start_m_s, const NodalArray& trial_m_s,
                  double stage_step_s, NodalArray& residual_m_s);

  const Body& body_;
  ImplicitScheme scheme_;
  double velocity_tolerance_m_s_;
  ForceEvaluator forces_;
  ImplicitMatrix matrix_;
  NodalArray inverse_mass_1_kg_;
  NodalArray external_N_;
  NodalArray trial_position_m_;
  NodalArray force_N_;
};

}  // namespace palpate::host
