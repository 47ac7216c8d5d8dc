// How warm the motors are, from their currents (I2t), and what currents they still bear.
//
// Two bodies for each motor, as its maker describes it: the winding, which heats its housing, which heats the
// room. Both temperatures are counted in units of what the continuous current leads to after a long time, so
// that neither the winding's resistance nor the room's temperature has to be known. With x the square of the
// current over the continuous one:
//   winding' = (x - winding) / winding_s, housing' = (winding - housing) / housing_s,
//   heat = winding_share winding + (1 - winding_share) housing;
// heat 1 is the winding's highest temperature. The resistance is taken as that of the hot winding: a cold one
// is warmer here than it is.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "firmware/core/supervisor.hpp"

namespace palpate::firmware {

// One writer, the servo interrupt. Modes, faults and arming leave it alone: none of them cools a motor.
struct MotorHeat {
  std::array<float, 3> winding{};   // above the housing
  std::array<float, 3> housing{};   // above the room
  std::uint32_t pending_ticks = 0;  // that the housings do not know of yet
};

// In float32 a housing with 900 s that is told of each tick would stand still within 2 % of its end.
inline constexpr std::uint32_t kHousingPeriod_ticks = 64;

// Of a board that does not know what was before. With 1 nothing hotter was left behind: what bearable
// currents lead to is no hotter in sum, and a winding cools faster than its housing.
[[nodiscard]] inline MotorHeat heat_at_start(const Limits& limits) {
  const float heat = limits.heat_at_start;
  return {.winding = {heat, heat, heat}, .housing = {heat, heat, heat}};
}

// How far a first-order lag goes within some ticks: all the way at most.
[[nodiscard]] inline float lag_step(std::uint32_t ticks, float time_s) {
  return std::min(1e-3f * static_cast<float>(ticks) / time_s, 1.0f);
}

// The ticks since the last call, all with these set-points, at whose end these currents are measured. The
// larger of both counts; measured ones no further than over_current lets them be, so that a single wrong
// reading does not fold the force by a step; one that is no number counts as that much.
inline void warm(MotorHeat& heat, const std::array<float, 3>& setpoint_A,
                 const std::array<float, 3>& measured_A, std::uint32_t elapsed_ticks, const Limits& limits) {
  heat.pending_ticks += elapsed_ticks;
  const bool reaches_housings = heat.pending_ticks >= kHousingPeriod_ticks;
  for (std::size_t i = 0; i < 3; ++i) {
    const float most_A = limits.over_current_ratio * limits.motor_current_A[i];
    const float current_A = std::max(std::fabs(setpoint_A[i]), std::min(most_A, std::fabs(measured_A[i])));
    const float ratio = current_A / limits.motor_continuous_A[i];
    heat.winding[i] += (ratio * ratio - heat.winding[i]) * lag_step(elapsed_ticks, limits.winding_s);
    if (reaches_housings)
      heat.housing[i] += (heat.winding[i] - heat.housing[i]) * lag_step(heat.pending_ticks, limits.housing_s);
  }
  if (reaches_housings) heat.pending_ticks = 0;
}

[[nodiscard]] inline float heat_of(const MotorHeat& heat, std::size_t motor, const Limits& limits) {
  return limits.winding_share * heat.winding[motor] + (1.0f - limits.winding_share) * heat.housing[motor];
}

[[nodiscard]] inline float hottest(const MotorHeat& heat, const Limits& limits) {
  return std::max({heat_of(heat, 0, limits), heat_of(heat, 1, limits), heat_of(heat, 2, limits)});
}

// The largest set-points: up to heat_fold those of a cold motor, and from there down to the continuous ones
// at 1. They are exactly those of a cold motor below it, so that nothing is limited there.
[[nodiscard]] inline std::array<float, 3> bearable_currents_A(const MotorHeat& heat, const Limits& limits) {
  std::array<float, 3> largest_A = limits.motor_current_A;
  for (std::size_t i = 0; i < 3; ++i) {
    const float fold =
        std::clamp((heat_of(heat, i, limits) - limits.heat_fold) / (1.0f - limits.heat_fold), 0.0f, 1.0f);
    largest_A[i] -= fold * std::max(largest_A[i] - limits.motor_continuous_A[i], 0.0f);
  }
  return largest_A;
}

}  // namespace palpate::firmware
