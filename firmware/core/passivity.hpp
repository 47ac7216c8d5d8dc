// Observer and controller of passivity in the time domain (Hannaford, Ryu, IEEE Trans. Robotics and
// Automation 18(1), 2002): what the rendered force has given the hand and never took, damping takes back.
//
// Two accounts. The port's: the work of the hand on what is rendered; what was taken is forgotten where
// nothing is touched, so that what friction has taken in one contact is no credit in the next. And the debt
// of model corrections: what late models have given too much (docs/decisions/correction_energy.md), which
// friction would hide in the first. A force holds from its tick to the next one, so that the first is exact;
// the second counts forces before the supervisor's limits. Neither remembers more than what a hand feels as a
// short drag.
#pragma once

#include <algorithm>

#include "shared/math/linear.hpp"

namespace palpate::firmware {

struct PassivityLimits {
  float allowance_J = 0.0f;    // created before anything is done about it
  float most_J = 0.0f;         // that either account remembers
  float damping_N_s_m = 0.0f;  // at most
  float force_N = 0.0f;        // likewise
};

struct PassivityState {
  float balance_J = 0.0f;  // taken from the hand, less given to it, in this contact
  float debt_J = 0.0f;     // of corrections, not taken back yet; never negative
  Vec3f damping_N{};       // what damping has added to the force in use

  friend bool operator==(const PassivityState&, const PassivityState&) = default;
};

// What one tick tells of the one before. Forces of the tip on the body.
struct PassivityInputs {
  Vec3f force_N{};            // that was in use, damping included
  Vec3f step_m{};             // of the tip since then; zero where it is not known
  float correction_J = 0.0f;  // given too much by what was rendered before a model was taken over
  bool touches = false;       // a force is asked for now
};

[[nodiscard]] inline PassivityState observe(PassivityState state, const PassivityInputs& in,
                                            const PassivityLimits& limits) {
  state.balance_J = std::max(state.balance_J + dot(in.force_N, in.step_m), -limits.most_J);
  if (!in.touches) state.balance_J = std::min(state.balance_J, 0.0f);
  state.debt_J =
      std::clamp(state.debt_J + in.correction_J - dot(state.damping_N, in.step_m), 0.0f, limits.most_J);
  return state;
}

// Created, beyond the allowance. The larger of the two: a correction shows in the balance, too, where it has
// not been hidden.
[[nodiscard]] inline float excess_J(const PassivityState& state, const PassivityLimits& limits) {
  return std::max(std::max(-state.balance_J, state.debt_J) - limits.allowance_J, 0.0f);
}

// To be added to the force of the tip on the body: along its motion, as strong as takes the excess back
// within one tick at this velocity, or as the limits allow. Zero where nothing is to be taken back, or
// nothing moves.
[[nodiscard]] inline Vec3f passivity_damping(const PassivityState& state, const Vec3f& velocity_m_s,
                                             float tick_s, const PassivityLimits& limits) {
  const float excess = excess_J(state, limits);
  const float speed_m_s = norm(velocity_m_s);
  if (!(excess > 0.0f && speed_m_s > 0.0f)) return {};
  const float wanted_N =
      std::min({excess / (tick_s * speed_m_s), limits.damping_N_s_m * speed_m_s, limits.force_N});
  return velocity_m_s * (wanted_N / speed_m_s);
}

}  // namespace palpate::firmware
