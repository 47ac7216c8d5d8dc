// What a board may set its supervisor's limits to. Ranges are those in which the rules of docs/safety.md
// still hold: no limit can be switched off, and nothing can be made to step.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware/core/supervisor.hpp"

namespace palpate::firmware {

template <class Value>
struct LimitRange {
  std::string_view name;
  Value Limits::*limit;
  Value least;
  Value most;
};

inline constexpr std::array kTickRanges{
    LimitRange<std::uint32_t>{"boot_ticks", &Limits::boot_ticks, 1, 1000},
    LimitRange<std::uint32_t>{"arming_window_ticks", &Limits::arming_window_ticks, 100, 10'000},
    LimitRange<std::uint32_t>{"soft_start_ticks", &Limits::soft_start_ticks, 20, 2000},
    // As long as a model may claim in a scene.
    LimitRange<std::uint32_t>{"model_horizon_ticks", &Limits::model_horizon_ticks, 1, 5000},
    LimitRange<std::uint32_t>{"model_fade_ticks", &Limits::model_fade_ticks, 20, 2000},
    // A host that is well says something every 100 ticks.
    LimitRange<std::uint32_t>{"link_silent_ticks", &Limits::link_silent_ticks, 150, 1000},
    LimitRange<std::uint32_t>{"damping_ticks", &Limits::damping_ticks, 0, 5000},
    LimitRange<std::uint32_t>{"link_lost_ticks", &Limits::link_lost_ticks, 1000, 60'000},
    LimitRange<std::uint32_t>{"direct_hold_ticks", &Limits::direct_hold_ticks, 1, 100},
    LimitRange<std::uint32_t>{"direct_fade_ticks", &Limits::direct_fade_ticks, 20, 1000},
    LimitRange<std::uint32_t>{"direct_lost_ticks", &Limits::direct_lost_ticks, 200, 5000},
    LimitRange<std::uint32_t>{"calibration_ticks", &Limits::calibration_ticks, 50, 1000},
    LimitRange<std::uint32_t>{"over_current_ticks", &Limits::over_current_ticks, 1, 20},
    LimitRange<std::uint32_t>{"current_tracking_ticks", &Limits::current_tracking_ticks, 1, 50},
    // One deadline in 20 ticks may be missed for ever, not more.
    LimitRange<std::uint32_t>{"missed_deadline_weight", &Limits::missed_deadline_weight, 20, 1000},
    LimitRange<std::uint32_t>{"missed_deadline_bucket", &Limits::missed_deadline_bucket, 1, 1000},
};

inline constexpr std::array kNumberRanges{
    LimitRange<float>{"peak_force_N", &Limits::peak_force_N, 0.1f, 40.0f},
    // No fault of the link may be felt as more than 0.5 N in a tick.
    LimitRange<float>{"force_step_N", &Limits::force_step_N, 0.01f, 0.5f},
    LimitRange<float>{"force_fault_N", &Limits::force_fault_N, 1.0f, 500.0f},
    // The damper swings beyond 3.75 N s/m with the lightest tip.
    LimitRange<float>{"damping_N_s_m", &Limits::damping_N_s_m, 0.1f, 3.75f},
    LimitRange<float>{"damping_force_N", &Limits::damping_force_N, 0.1f, 2.0f},
    LimitRange<float>{"energy_J", &Limits::energy_J, 0.01f, 5.0f},
    LimitRange<float>{"energy_leak_W", &Limits::energy_leak_W, 0.0f, 5.0f},
    LimitRange<float>{"passivity_allowance_J", &Limits::passivity_allowance_J, 0.0f, 0.1f},
    LimitRange<float>{"passivity_most_J", &Limits::passivity_most_J, 0.0f, 1.0f},
    LimitRange<float>{"direct_force_N", &Limits::direct_force_N, 0.1f, 40.0f},
    LimitRange<float>{"direct_force_step_N", &Limits::direct_force_step_N, 0.01f, 0.5f},
    LimitRange<float>{"direct_energy_J", &Limits::direct_energy_J, 0.01f, 30.0f},
    LimitRange<float>{"joint_step_rad", &Limits::joint_step_rad, 0.001f, 0.2f},
    LimitRange<float>{"tip_speed_m_s", &Limits::tip_speed_m_s, 0.1f, 10.0f},
    LimitRange<float>{"over_current_ratio", &Limits::over_current_ratio, 1.0f, 3.0f},
    LimitRange<float>{"current_tracking_A", &Limits::current_tracking_A, 0.1f, 5.0f},
    LimitRange<float>{"winding_share", &Limits::winding_share, 0.05f, 0.9f},
    LimitRange<float>{"winding_s", &Limits::winding_s, 1.0f, 100.0f},
    LimitRange<float>{"housing_s", &Limits::housing_s, 10.0f, 10'000.0f},
    LimitRange<float>{"heat_fold", &Limits::heat_fold, 0.1f, 0.95f},
    LimitRange<float>{"heat_fault", &Limits::heat_fault, 1.02f, 1.5f},
    LimitRange<float>{"heat_at_start", &Limits::heat_at_start, 0.0f, 1.0f},
};
inline constexpr std::int32_t kMostCalibrationMotion_count = 10;
inline constexpr float kMostMotorCurrent_A = 50.0f;

// How far the force may move in a tick by heat alone: by the share of the currents that folding takes while
// the motors heat with the largest current that is no fault.
inline constexpr float kMostFold_N = 0.5f;
constexpr bool folds_smoothly(const Limits& limits) {
  for (std::size_t i = 0; i < 3; ++i) {
    const float peak_A = limits.motor_current_A[i], continuous_A = limits.motor_continuous_A[i];
    const float ratio = limits.over_current_ratio * peak_A / continuous_A;
    const float heat_per_tick = limits.winding_share * ratio * ratio * 1e-3f / limits.winding_s;
    const float fold_per_tick = heat_per_tick / (1.0f - limits.heat_fold);
    if (limits.peak_force_N * fold_per_tick * (peak_A - continuous_A) / continuous_A > kMostFold_N)
      return false;
  }
  return true;
}

// Deadlines in a row that may be missed.
inline constexpr std::uint32_t kMostMissedDeadlines = 10;

// A link that does not return is a fault after link_lost_ticks: by then outputs must have gone off, whatever
// a model claims.
constexpr bool lost_after_off(const Limits& limits) {
  const std::uint32_t faded = limits.model_horizon_ticks + limits.model_fade_ticks;
  const std::uint32_t damped = faded > limits.link_silent_ticks ? faded : limits.link_silent_ticks;
  return damped + limits.damping_ticks <= limits.link_lost_ticks;
}

// The name of the first limit that is out of its range or does not go with another, empty where all are good;
// NaN is out of every range.
constexpr std::string_view bad_limit(const Limits& limits) {
  const auto within = [&limits](const auto& range) {
    return limits.*range.limit >= range.least && limits.*range.limit <= range.most;
  };
  for (const auto& range : kTickRanges)
    if (!within(range)) return range.name;
  for (const auto& range : kNumberRanges)
    if (!within(range)) return range.name;
  if (limits.calibration_motion_count < 0 || limits.calibration_motion_count > kMostCalibrationMotion_count)
    return "calibration_motion_count";
  for (const float current_A : limits.motor_current_A)
    if (!(current_A > 0.0f && current_A <= kMostMotorCurrent_A)) return "motor_current_A";
  for (const float current_A : limits.motor_continuous_A)
    if (!(current_A > 0.0f && current_A <= kMostMotorCurrent_A)) return "motor_continuous_A";
  if (limits.peak_force_N > limits.force_fault_N) return "force_fault_N";    // a fault of what is allowed
  if (limits.direct_force_N > limits.peak_force_N) return "direct_force_N";  // any program may send one
  if (limits.direct_hold_ticks + limits.direct_fade_ticks > limits.direct_lost_ticks)
    return "direct_lost_ticks";
  if (limits.missed_deadline_bucket > kMostMissedDeadlines * limits.missed_deadline_weight)
    return "missed_deadline_bucket";
  if (!lost_after_off(limits)) return "link_lost_ticks";
  if (!folds_smoothly(limits)) return "heat_fold";
  return {};
}

}  // namespace palpate::firmware
