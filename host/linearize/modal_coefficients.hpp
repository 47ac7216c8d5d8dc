// Exact discretization of one mode.
#pragma once

namespace palpate::host {

// One step of a mode with position q, velocity p and constant modal force u over the step:
//   q += a11 q + a12 p + b1 u
//   p += a21 q + a22 p + b2 u
// The a are those of A - I, so that the slow motion of a soft mode keeps its digits in single precision.
struct ModalCoefficients {
  double a11 = 0;
  double a12 = 0;  // s
  double a21 = 0;  // 1/s
  double a22 = 0;
  double b1 = 0;  // s^2
  double b2 = 0;  // s
};

// Phase of the damped oscillation that a mode may turn through in a step and still be sampled exactly; pi is
// the Nyquist frequency. Beyond pi the sampled mode appears as a slower one, and its answer to a force held
// for one step, b1 = (1 - cos(phase)) / lambda without damping, falls again and vanishes at 2 pi: a contact
// that asks which force closes a gap by the end of the step would find no compliance where there is one. 2.5
// keeps a margin below pi; b1 is there 1.8 / lambda sampled and 0.86 / lambda by backward Euler.
inline constexpr double kLargestResolvedPhase_rad = 2.5;

// Coefficients of q'' = -lambda q - d q' + u over a step h. Any finite lambda: negative ones grow; d >= 0, or
// slightly negative. Exact (matrix exponential) where the mode does not oscillate or turns by at most
// kLargestResolvedPhase_rad; beyond that backward Euler, (I - h G)^-1: stable, without ringing, with the
// exact static response 1 / lambda. Overdamped modes do not oscillate, however stiff. Throws
// std::invalid_argument for arguments that are not finite, a step that is not positive, or a mode that grows
// beyond all numbers within the step.
ModalCoefficients modal_coefficients(double lambda_rad2_s2, double damping_rad_s, double step_s);

}  // namespace palpate::host
