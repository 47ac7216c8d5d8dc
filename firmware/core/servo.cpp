#include "firmware/core/servo.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/ServoSample_1_0.h"
#include "shared/device/actuation.hpp"

namespace palpate::firmware {
namespace {

constexpr float kTick_s = 1e-3f;

std::int32_t difference(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}

bool moved(const device::EncoderCounts& from, const device::EncoderCounts& to, std::int32_t allowed_count) {
  bool any = false;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int32_t change = difference(to[i], from[i]);
    any = any || change > allowed_count || change < -allowed_count;
  }
  return any;
}

}  // namespace

CurrentLimit reaction_currents(const device::Parameters& device, const device::Pose& pose,
                               const Vec3f& force_N, const std::array<float, 3>& largest_A,
                               const Vec3f& friction_N_m) {
  const Vec3f torque_N_m = device::joint_torque(pose, -force_N) + pose.gravity_torque_N_m + friction_N_m;
  const device::CurrentSetpoints currents = device::motor_currents(device, torque_N_m);
  // Scale 0 is how motor_currents() reports what is not finite; its own zeros would pass for a command.
  if (!(currents.scale > 0.0f)) return {.finite = false};
  CurrentLimit result =
      limit_currents({currents.current_A.x, currents.current_A.y, currents.current_A.z}, largest_A);
  result.limited = result.limited || currents.scale < 1.0f;
  return result;
}

void Servo::use(const Tuning& tuning) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (tuning.encoder_sign[i] == tuning_.encoder_sign[i]) continue;
    // Counts turn over, those that are remembered too: the reference pose stays where it is.
    reference_count_[i] = difference(0, reference_count_[i]);
    previous_count_[i] = difference(0, previous_count_[i]);
    estimators_[i] = {};
    have_tip_ = false;
  }
  tuning_ = tuning;
  compensates_friction_ = false;
  for (std::size_t i = 0; i < 3; ++i) {
    compensates_friction_ = compensates_friction_ || tuning.friction_share[i] > 0.0f;
    const float nominal_N_m = kNominalGravity_N_m[i];
    gravity_ratio_[i] = nominal_N_m != 0.0f ? tuning.gravity_torque_N_m[i] / nominal_N_m : 1.0f;
  }
}

// What differs from the nominal arm comes with the soft start of arming: a wrong register is no jerk.
float Servo::tuned_share(const SupervisorState& state) const {
  if (state.mode_age_ticks >= limits_.soft_start_ticks) return 1.0f;
  return static_cast<float>(state.mode_age_ticks) / static_cast<float>(limits_.soft_start_ticks);
}

// That the motors bear, and of which the amplifiers are told no more than the limit.
std::array<float, 3> Servo::largest_currents_A() const {
  std::array<float, 3> largest_A = bearable_currents_A(heat_, limits_);
  for (std::size_t i = 0; i < 3; ++i) {
    const float left_A = std::max(0.0f, limits_.motor_current_A[i] - std::fabs(tuning_.setpoint_offset_A[i]));
    largest_A[i] = std::min(largest_A[i], left_A / tuning_.setpoint_gain[i]);
  }
  return largest_A;
}

// In a tick that begins with outputs off, and in which nothing switches them on.
void Servo::take_tuning() {
  switch (mailbox_.tuning_step.load(std::memory_order_acquire)) {
    case TuningStep::asked: {
      const bool agreed = !is_armed(state_.mode) && state_.mode != Mode::calibrate;
      mailbox_.tuning_step.store(agreed ? TuningStep::agreed : TuningStep::refused,
                                 std::memory_order_release);
      break;
    }
    case TuningStep::commit: {
      const Tuning& tuning = mailbox_.tuning;
      // Who has asked for a challenge has not seen these: it has to ask again.
      state_.token = 0;
      // A tip that is suddenly elsewhere is no place for the models that know it here.
      if (tuning.encoder_sign != tuning_.encoder_sign) forget_models();
      use(tuning);
      mailbox_.tuning_step.store(TuningStep::done, std::memory_order_release);
      break;
    }
    case TuningStep::idle:
    case TuningStep::refused:
    case TuningStep::agreed:
    case TuningStep::done:
      break;
  }
}

ServoSensors Servo::corrected(const ServoSensors& sensors) const {
  ServoSensors corrected = sensors;
  for (std::size_t i = 0; i < 3; ++i) {
    if (tuning_.encoder_sign[i] < 0.0f) corrected.count[i] = difference(0, sensors.count[i]);
    corrected.measured_current_A[i] =
        tuning_.monitor_gain[i] * (sensors.measured_current_A[i] - tuning_.monitor_offset_A[i]);
  }
  return corrected;
}

void Servo::post_sample(const ServoTiming& timing, const ServoSensors& raw, const ServoSensors& sensors,
                        const Vec3f& joint_rad, const std::array<float, 3>& setpoint_A) {
  if (!mailbox_.samples_wanted.load(std::memory_order_relaxed)) return;
  const Vec3f joint_rad_s = device::estimated_joint_velocity(device_, estimators_);
  (void)mailbox_.samples.push({.tick = timing.tick,
                               .encoder_count = raw.count,
                               .joint_rad = {joint_rad.x, joint_rad.y, joint_rad.z},
                               .joint_rad_s = {joint_rad_s.x, joint_rad_s.y, joint_rad_s.z},
                               .setpoint_A = setpoint_A,
                               .measured_current_A = sensors.measured_current_A});
}

SupervisorInputs Servo::gather(const ServoTiming& timing, const ServoSensors& sensors,
                               const device::Pose& pose, const ServoSample& sample) {
  SupervisorInputs in;
  in.tick = timing.tick;
  in.elapsed_ticks = timing.elapsed_ticks;
  in.missed_deadlines = timing.new_missed_deadlines;
  in.emergency_stop_open = sensors.emergency_stop_open;
  in.supply_low = sensors.supply_low;
  in.measured_current_A = sensors.measured_current_A;
  for (std::size_t i = 0; i < 3; ++i)
    in.current_error_A =
        std::max(in.current_error_A, std::fabs(sensors.measured_current_A[i] - setpoint_A_[i]));
  in.hottest_motor = hottest(heat_, limits_);
  const float elapsed = static_cast<float>(timing.elapsed_ticks);
  if (have_counts_) {
    const Vec3f step_rad = device::joint_angles(device_, sensors.count, previous_count_);
    for (std::size_t i = 0; i < 3; ++i) {
      const float magnitude_rad = std::fabs(step_rad[i]) / elapsed;
      if (magnitude_rad > in.joint_step_rad) in.joint_step_rad = magnitude_rad;
    }
    const device::EncoderCounts& rest = state_.mode == Mode::calibrate ? rest_count_ : previous_count_;
    in.at_rest = !moved(rest, sensors.count, limits_.calibration_motion_count);
  }
  const bool pose_known = (pose.faults & device::kInvalidAngle) == 0;
  // A pose that kinematics cannot know has no position, and the supervisor must see that.
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  in.tip_m = pose_known ? pose.tip_m : Vec3f{kUnknown, kUnknown, kUnknown};
  if (have_tip_ && pose_known) {
    in.tip_step_m = pose.tip_m - tip_m_;
    in.tip_speed_m_s = norm(in.tip_step_m) / (elapsed * kTick_s);
  }
  in.link_age_ticks = link_age_ticks_;
  in.inside_workspace = pose.faults == 0;
  in.force_N = sample.force_N;
  in.model_sequence = renderer_.model_sequence();
  in.model_age_ticks = renderer_.model_age_ticks();
  in.model_valid_ticks = renderer_.model_valid_ticks();
  in.model_growth_ticks = renderer_.model_growth_ticks();
  in.model_use_ticks = renderer_.model_use_ticks();
  // Only what may be damped asks for it, and what the force has created.
  const std::uint32_t horizon = std::min(in.model_valid_ticks, limits_.model_horizon_ticks);
  const bool is_taken_back = excess_J(state_.passivity, passivity_limits(limits_)) > 0.0f;
  if (have_tip_ && pose_known &&
      (is_taken_back || link_age_ticks_ > limits_.link_silent_ticks || in.model_age_ticks > horizon))
    in.tip_velocity_m_s = device::estimated_velocity(device_, pose, estimators_);
  in.correction_J = renderer_.correction_energy_J() - correction_J_;
  correction_J_ = renderer_.correction_energy_J();
  in.direct_force_N = direct_force_N_;
  in.direct_age_ticks = direct_age_ticks_;
  return in;
}

void Servo::update_estimate(const ServoTiming& timing, const ServoSensors& sensors) {
  if (!have_counts_) return;
  for (std::size_t i = 0; i < 3; ++i)
    estimators_[i].update(static_cast<float>(difference(sensors.count[i], previous_count_[i])),
                          static_cast<float>(timing.elapsed_ticks));
}

void Servo::take_direct_forces(std::uint32_t elapsed_ticks) {
  // What was sent before the outputs came on is never felt.
  const bool is_felt = state_.mode == Mode::direct;
  const std::uint32_t age = direct_age_ticks_ + elapsed_ticks;
  direct_age_ticks_ = !is_felt || age < direct_age_ticks_ ? UINT32_MAX : age;
  if (!is_felt) direct_force_N_ = {};
  for (Vec3f force_N; mailbox_.direct_forces.pop(force_N);) {
    if (!is_felt) continue;
    direct_force_N_ = -force_N;  // the hand's to the body's
    direct_age_ticks_ = 0;
  }
}

bool Servo::take_command(CommandRequest& request) {
  const TuningStep step = mailbox_.tuning_step.load(std::memory_order_relaxed);
  const std::uint32_t stops = mailbox_.stops.load(std::memory_order_relaxed);
  const std::uint32_t disarms = mailbox_.disarms.load(std::memory_order_relaxed);
  const bool stop = stops != stops_;
  // From its consent on to its end nothing is obeyed that could arm.
  if (!stop && disarms == disarms_)
    return step != TuningStep::agreed && step != TuningStep::commit && mailbox_.commands.pop(request);
  stops_ = stops;
  disarms_ = disarms;
  for (CommandRequest late; mailbox_.commands.pop(late);)
    (void)mailbox_.replies.push(
        {{late.command.action, Status::command_refused, 0}, state_.mode, late.requester});
  request.command = {stop ? Action::stop : Action::disarm};
  return false;
}

void Servo::listen_to_host(std::uint32_t elapsed_ticks) {
  const std::uint32_t frames = mailbox_.host_frames.load(std::memory_order_relaxed);
  const std::uint32_t age = link_age_ticks_ + elapsed_ticks;
  link_age_ticks_ = age < link_age_ticks_ ? UINT32_MAX : age;
  if (frames != host_frames_) link_age_ticks_ = 0;
  host_frames_ = frames;
}

void Servo::forget_models() {
  renderer_.isr_reset();
  correction_J_ = renderer_.correction_energy_J();
}

void Servo::note_who_armed(const Decision& decision, const CommandRequest& request) {
  const bool was_armed = mailbox_.is_armed.load(std::memory_order_relaxed);
  const bool is_armed = palpate::firmware::is_armed(decision.state.mode);
  mailbox_.is_armed.store(is_armed, std::memory_order_relaxed);
  if (was_armed || !is_armed) return;
  link_age_ticks_ = 0;
  mailbox_.armed_node.store(request.requester.node, std::memory_order_relaxed);
  // A program's force and a model's do not mix, nor models of two hosts: none is waiting when its time comes.
  const std::uint16_t node = mailbox_.model_node.load(std::memory_order_relaxed);
  if (decision.state.mode == Mode::direct || (node != kNoNode && node != request.requester.node))
    forget_models();
}

ServoOutput Servo::isr_tick(const ServoTiming& timing, const ServoSensors& raw) {
  take_tuning();
  const ServoSensors sensors = corrected(raw);
  const Vec3f joint_rad = device::joint_angles(device_, sensors.count, reference_count_);
  device::Pose pose = device::evaluate(device_, joint_rad);
  const bool pose_known = (pose.faults & device::kInvalidAngle) == 0;

  ServoOutput output;
  update_estimate(timing, sensors);
  // The renderer needs a tick number without gaps of its own making: where the tip is unknown it stays.
  if (pose_known)
    rendered_tip_m_ =
        renderer_.estimates_tip() ? device::estimated_tip(device_, pose, estimators_) : pose.tip_m;
  output.sample = renderer_.isr_tick(timing.tick, rendered_tip_m_);

  take_direct_forces(timing.elapsed_ticks);
  listen_to_host(timing.elapsed_ticks);
  warm(heat_, setpoint_A_, sensors.measured_current_A, timing.elapsed_ticks, limits_);
  SupervisorInputs in = gather(timing, sensors, pose, output.sample);
  CommandRequest request;
  const bool commanded = take_command(request);
  in.command = request.command;
  in.command_node = request.requester.node;

  Decision decision = supervise(state_, in, limits_, challenge_seed_);
  if (decision.outputs_on) {
    const float share = tuned_share(decision.state);
    for (std::size_t i = 0; i < 3; ++i)
      pose.gravity_torque_N_m[i] *= 1.0f + share * (gravity_ratio_[i] - 1.0f);
    Vec3f friction_N_m{};
    if (compensates_friction_)
      friction_N_m =
          friction_compensation(tuning_, device::estimated_joint_velocity(device_, estimators_)) * share;
    const CurrentLimit currents =
        reaction_currents(device_, pose, decision.state.force_N, largest_currents_A(), friction_N_m);
    output.setpoint_A = currents.setpoint_A;
    decision.force_limited = decision.force_limited || currents.limited;
    if (!currents.finite) decision = trip(decision, Fault::not_a_number);
  }

  if (decision.calibration_begins) rest_count_ = sensors.count;
  previous_count_ = sensors.count;
  have_counts_ = true;
  tip_m_ = pose_known ? pose.tip_m : tip_m_;
  have_tip_ = pose_known;
  if (decision.calibration_ends) {
    reference_count_ = sensors.count;
    // The tip has moved without having moved: no speed, and no model that knew it elsewhere.
    have_tip_ = false;
    forget_models();
  }

  note_who_armed(decision, request);

  if (commanded) {
    // Never full: it holds twice as many as can be under way.
    (void)mailbox_.replies.push({decision.outcome, decision.state.mode, request.requester});
  }
  mailbox_.urgent_mode.store(decision.state.mode, std::memory_order_relaxed);
  mailbox_.urgent_done.store(stops_ + disarms_, std::memory_order_release);
  post(timing, decision);
  record_flags(timing, decision);
  state_ = decision.state;
  post_device(timing, pose);

  if (!decision.outputs_on) output.setpoint_A = {};
  setpoint_A_ = output.setpoint_A;
  post_sample(timing, raw, sensors, joint_rad, output.setpoint_A);
  if (decision.outputs_on)
    for (std::size_t i = 0; i < 3; ++i)
      output.setpoint_A[i] = tuning_.setpoint_gain[i] * output.setpoint_A[i] - tuning_.setpoint_offset_A[i];
  output.outputs_on = decision.outputs_on;
  output.force_N = state_.force_N;
  output.mode = state_.mode;
  output.faults = state_.faults;
  return output;
}

void Servo::post(const ServoTiming& timing, const Decision& decision) {
  const SupervisorState& state = decision.state;
  if (state.mode != state_.mode) status_due_ = true;
  if (static_cast<std::int32_t>(timing.tick - next_status_tick_) >= 0) {
    status_due_ = true;
    next_status_tick_ = timing.tick - timing.tick % kStatusPeriod_ticks + kStatusPeriod_ticks;
  }
  if (status_due_) {
    status_due_ = !mailbox_.status.push({timing.tick, state.mode, state.faults, state.token,
                                         timing.missed_deadlines, timing.worst_tick_count});
  }
}

void Servo::post_device(const ServoTiming& timing, const device::Pose& pose) {
  if (!mailbox_.device_wanted.load(std::memory_order_relaxed)) return;
  // Full: the background has not run for two ticks.
  (void)mailbox_.device.push(
      {.tick = timing.tick,
       .tip_m = tip_m_,
       // Of a pose that kinematics cannot know, as of one just calibrated, it is none.
       .velocity_m_s = have_tip_ ? device::estimated_velocity(device_, pose, estimators_) : Vec3f{},
       .force_N = state_.force_N,
       .mode = state_.mode,
       .flags = flags_[timing.tick % kTipHistory].load(std::memory_order_relaxed),
       .faults = state_.faults});
}

void Servo::record_flags(const ServoTiming& timing, const Decision& decision) {
  std::uint8_t flags = 0;
  if (decision.outputs_on) flags |= palpate_ServoSample_1_0_FLAG_RENDERING;
  if (decision.state.mode == Mode::direct) flags |= palpate_ServoSample_1_0_FLAG_DIRECT;
  if (decision.force_limited) flags |= palpate_ServoSample_1_0_FLAG_LIMITED;
  // Lost ticks have this tick's sample in the renderer's history, and this tick's flags here.
  const std::uint32_t count = timing.elapsed_ticks < kTipHistory ? timing.elapsed_ticks : kTipHistory;
  for (std::uint32_t i = 0; i < count; ++i) {
    flags_[(timing.tick - i) % kTipHistory].store(flags, std::memory_order_relaxed);
  }
  next_tick_.store(timing.tick + 1, std::memory_order_release);
}

bool Servo::sample(std::uint32_t tick, ServoSample& out) const {
  if (static_cast<std::int32_t>(next_tick() - tick) <= 0) return false;
  const std::uint8_t flags = flags_[tick % kTipHistory].load(std::memory_order_relaxed);
  if (!renderer_.sample(tick, out)) return false;
  out.flags = static_cast<std::uint8_t>(out.flags | flags);
  return true;
}

}  // namespace palpate::firmware
