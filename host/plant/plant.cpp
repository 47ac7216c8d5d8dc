#include "host/plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "host/plant/check.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::plant {
namespace {

constexpr double kLongest_s = 1.0;  // a call of advance()

int substeps(double duration_s, double substep_s) {
  // Rounding in duration / substep must not add a substep.
  constexpr double kRounding = 1e-9;
  return static_cast<int>(std::ceil(duration_s / substep_s - kRounding));
}

}  // namespace

Plant::Plant(const PlantParameters& parameters, TipPath intended)
    : hand_kind_(parameters.hand_kind),
      arm_(parameters.arm),
      amplifiers_(parameters.amplifiers),
      hand_(parameters.hand),
      intended_(std::move(intended)),
      encoder_reference_(parameters.encoder_reference),
      substep_s_(parameters.substep_s) {
  require_range("plant substep_s", substep_s_, 1e-7, 1e-3);
  set_grip(parameters.grip);
  const Vec3d start_m = intended_.at(0.0).position_m;
  state_.joint_rad = arm_.joint_angles_rad(start_m, "start of the tip path");
  state_.hand.position_m = start_m;
}

Plant::Plant(const PlantParameters& parameters, RecordedMotion recorded)
    : hand_kind_(HandKind::recorded),
      arm_(parameters.arm),
      amplifiers_(parameters.amplifiers),
      hand_(parameters.hand),
      intended_(TipPath::samples({{0.0, {}}})),
      encoder_reference_(parameters.encoder_reference),
      // The currents of then, to the bit, come from the steps of then.
      substep_s_(parameters.hand_kind == HandKind::scripted ? kLongest_s : parameters.substep_s),
      recorded_(std::move(recorded)) {
  if (recorded_.encoder_count.empty() || recorded_.encoder_count.size() != recorded_.tip_m.size()) {
    std::ostringstream message;
    message << "recorded motion has " << recorded_.encoder_count.size() << " encoder readings and "
            << recorded_.tip_m.size() << " tip positions, allowed: as many, at least 1";
    throw std::invalid_argument(message.str());
  }
  set_grip(parameters.grip);
}

std::size_t Plant::recorded_tick() const {
  return std::min(static_cast<std::size_t>(std::lround(time_s_ / kTick_s)), recorded_.tip_m.size() - 1);
}

Vec3d Plant::tip_position_m() const {
  return hand_kind_ == HandKind::recorded ? recorded_.tip_m[recorded_tick()]
                                          : arm_.tip_position_m(state_.joint_rad);
}

Vec3d Plant::intended_position_m() const {
  return hand_kind_ == HandKind::recorded ? tip_position_m() : intended(time_s_).position_m;
}

void Plant::guide(const PathPoint& intended) {
  if (hand_kind_ != HandKind::impedance)
    throw std::invalid_argument("plant: only a hand of kind impedance can be guided");
  if (!is_finite(intended.position_m) || !is_finite(intended.velocity_m_s))
    throw std::invalid_argument("plant: the point that guides the hand is not finite");
  guide_ = intended;
  guided_at_s_ = time_s_;
}

PathPoint Plant::intended(double time_s) const {
  if (!guide_) return intended_.at(time_s);
  return {guide_->position_m + guide_->velocity_m_s * (time_s - guided_at_s_), guide_->velocity_m_s};
}

void Plant::set_grip(double grip) {
  require_range("grip", grip, 0.0, 1.0);
  grip_ = grip;
}

// The state's rate of change delay_s after time_s_; the fields of the result hold the rates of the fields.
Plant::State Plant::derivative(const State& state, double delay_s) const {
  const Vec3d tip_m_s = arm_.jacobian_m(state.joint_rad) * state.joint_rad_s;
  const Vec3d force_N = hand_.force_N(state.hand, arm_.tip_position_m(state.joint_rad), tip_m_s, grip_);
  const Vec3d drive_N_m = arm_.drive_torque_N_m(amplifiers_.current_A(delay_s));
  return {
      state.joint_rad_s,
      arm_.acceleration_rad_s2(state.joint_rad, state.joint_rad_s, drive_N_m, force_N),
      {state.hand.velocity_m_s, hand_.acceleration_m_s2(state.hand, intended(time_s_ + delay_s), force_N)}};
}

void Plant::substep(double step_s) {
  const auto moved = [this](const State& rate, double by_s) {
    State state = state_;
    state.joint_rad += rate.joint_rad * by_s;
    state.joint_rad_s += rate.joint_rad_s * by_s;
    state.hand.position_m += rate.hand.position_m * by_s;
    state.hand.velocity_m_s += rate.hand.velocity_m_s * by_s;
    return state;
  };
  const double half_s = 0.5 * step_s;
  const State k1 = derivative(state_, 0.0);
  const State k2 = derivative(moved(k1, half_s), half_s);
  const State k3 = derivative(moved(k2, half_s), half_s);
  const State k4 = derivative(moved(k3, step_s), step_s);
  const auto mean = [](const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    return (a + 2.0 * (b + c) + d) * (1.0 / 6.0);
  };
  const State rate{
      mean(k1.joint_rad, k2.joint_rad, k3.joint_rad, k4.joint_rad),
      mean(k1.joint_rad_s, k2.joint_rad_s, k3.joint_rad_s, k4.joint_rad_s),
      {mean(k1.hand.position_m, k2.hand.position_m, k3.hand.position_m, k4.hand.position_m),
       mean(k1.hand.velocity_m_s, k2.hand.velocity_m_s, k3.hand.velocity_m_s, k4.hand.velocity_m_s)}};
  state_ = moved(rate, step_s);
  amplifiers_.advance(step_s);
  time_s_ += step_s;
}

void Plant::integrate(double duration_s) {
  const int steps = substeps(duration_s, substep_s_);
  const double end_s = time_s_ + duration_s;
  for (int step = 0; step < steps; ++step) substep(duration_s / steps);
  time_s_ = end_s;  // not the sum of the substeps, whose rounding would add up
}

void Plant::follow_script(double duration_s) {
  amplifiers_.advance(duration_s);
  time_s_ += duration_s;
  const PathPoint there = intended_.at(time_s_);
  const Vec3d before_rad_s = state_.joint_rad_s;
  state_.joint_rad = arm_.joint_angles_rad(there.position_m, "scripted tip");
  // The Jacobian is regular within the workspace, which joint_angles_rad has checked.
  if (!solve(arm_.jacobian_m(state_.joint_rad), there.velocity_m_s, state_.joint_rad_s))
    throw std::runtime_error("scripted tip: the arm is in a singular pose");
  joint_rad_s2_ = (state_.joint_rad_s - before_rad_s) * (1.0 / duration_s);
  state_.hand = {there.position_m, there.velocity_m_s};
}

void Plant::go_on_in_record(double duration_s) {
  const int steps = substeps(duration_s, substep_s_);
  for (int step = 0; step < steps; ++step) amplifiers_.advance(duration_s / steps);
  time_s_ += duration_s;
}

void Plant::advance(const std::array<float, 3>& setpoint_A, bool enabled, double duration_s) {
  require_range("plant duration_s", duration_s, 1e-6, kLongest_s);
  amplifiers_.command({static_cast<double>(setpoint_A[0]), static_cast<double>(setpoint_A[1]),
                       static_cast<double>(setpoint_A[2])},
                      enabled);
  switch (hand_kind_) {
    case HandKind::scripted:
      follow_script(duration_s);
      break;
    case HandKind::recorded:
      go_on_in_record(duration_s);
      break;
    case HandKind::impedance:
      integrate(duration_s);
      break;
  }
  if (!is_finite(state_.joint_rad) || !is_finite(state_.joint_rad_s) || !is_finite(state_.hand.position_m) ||
      !is_finite(state_.hand.velocity_m_s)) {
    std::ostringstream message;
    message << "the plant's state is not finite any more at " << time_s_
            << " s: its parameters are too stiff for substeps of " << substep_s_ << " s";
    throw std::runtime_error(message.str());
  }
}

device::EncoderCounts Plant::encoder_counts() const {
  if (hand_kind_ == HandKind::recorded) return recorded_.encoder_count[recorded_tick()];
  device::EncoderCounts count = arm_.encoder_counts(state_.joint_rad);
  for (std::size_t i = 0; i < 3; ++i)  // counters wrap around
    count[i] = static_cast<std::int32_t>(static_cast<std::uint32_t>(count[i]) +
                                         static_cast<std::uint32_t>(encoder_reference_[i]));
  return count;
}

std::array<float, 3> Plant::measured_current_A() const {
  const Vec3d current_A = amplifiers_.current_A(0.0);
  return {static_cast<float>(current_A.x), static_cast<float>(current_A.y), static_cast<float>(current_A.z)};
}

Vec3d Plant::hand_force_N() const {
  if (hand_kind_ == HandKind::recorded) {
    constexpr double kNobody = std::numeric_limits<double>::quiet_NaN();
    return {kNobody, kNobody, kNobody};
  }
  if (hand_kind_ == HandKind::scripted) {
    const Vec3d torque_N_m = arm_.mass_matrix_kg_m2(state_.joint_rad) * joint_rad_s2_ +
                             arm_.coriolis_torque_N_m(state_.joint_rad, state_.joint_rad_s) +
                             arm_.gravity_torque_N_m(state_.joint_rad) -
                             arm_.friction_torque_N_m(state_.joint_rad_s) -
                             arm_.stop_torque_N_m(state_.joint_rad, state_.joint_rad_s) -
                             arm_.drive_torque_N_m(amplifiers_.current_A(0.0));
    Vec3d force_N{};
    if (!solve(transpose(arm_.jacobian_m(state_.joint_rad)), torque_N_m, force_N))
      throw std::runtime_error("scripted tip: the arm is in a singular pose, no force of the hand holds it");
    return force_N;
  }
  return hand_.force_N(state_.hand, tip_position_m(), tip_velocity_m_s(), grip_);
}

}  // namespace palpate::plant
