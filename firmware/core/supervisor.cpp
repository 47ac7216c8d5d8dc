#include "firmware/core/supervisor.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::firmware {
namespace {

constexpr float kTick_s = 1e-3f;

// Adds without wrapping: an age that has reached its end stays there.
std::uint32_t saturating_add(std::uint32_t a, std::uint32_t b) {
  const std::uint32_t sum = a + b;
  return sum < a ? UINT32_MAX : sum;
}

bool finite(const std::array<float, 3>& values) {
  return std::isfinite(values[0]) && std::isfinite(values[1]) && std::isfinite(values[2]);
}

Vec3f shortened(const Vec3f& force_N, float longest_N) {
  const float magnitude_N = norm(force_N);
  return magnitude_N > longest_N ? force_N * (longest_N / magnitude_N) : force_N;
}

// A token that nobody sends by accident: the tick and the seed, mixed (finalizer of MurmurHash3); never 0.
std::uint32_t make_token(std::uint32_t tick, std::uint32_t seed) {
  std::uint32_t x = tick ^ seed;
  x = (x ^ (x >> 16)) * 0x85ebca6bu;
  x = (x ^ (x >> 13)) * 0xc2b2ae35u;
  x ^= x >> 16;
  return x != 0 ? x : 1;
}

void enter(SupervisorState& state, Mode mode) {
  state.mode = mode;
  state.mode_age_ticks = 0;
  state.token = 0;
  state.token_age_ticks = 0;
  state.token_is_direct = false;
  state.token_node = 0;
  state.force_was_lost = false;
  state.growth_had_ended = false;
  state.grown_N = 0.0f;
  state.soft_start_ticks = 0;
  state.damping_ticks = 0;
  state.energy_J = 0.0f;
  state.passivity = {};
}

// Faults of a broken device: whatever the mode.
FaultSet faults_always(const SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  FaultSet faults = 0;
  if (in.emergency_stop_open) faults |= bit(Fault::emergency_stop);
  if (in.supply_low) faults |= bit(Fault::supply_low);
  if (in.command.action == Action::stop) faults |= bit(Fault::stop_command);
  if (!is_finite(in.tip_m) || !is_finite(in.force_N) || !is_finite(in.direct_force_N) ||
      !finite(in.measured_current_A) || !std::isfinite(in.joint_step_rad) ||
      !std::isfinite(in.tip_speed_m_s) || !is_finite(in.tip_step_m) || !is_finite(in.tip_velocity_m_s) ||
      !std::isfinite(in.correction_J)) {
    faults |= bit(Fault::not_a_number);
  }
  if (in.joint_step_rad > limits.joint_step_rad) faults |= bit(Fault::encoder_jump);
  if (state.over_current_ticks >= limits.over_current_ticks) faults |= bit(Fault::over_current);
  if (!(in.hottest_motor <= limits.heat_fault)) faults |= bit(Fault::motor_heat);
  return faults;
}

// Faults of motion, model and time: harmless while the outputs are off, but they also keep them from being
// armed.
FaultSet faults_of_rendering(const SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  FaultSet faults = 0;
  if (in.tip_speed_m_s > limits.tip_speed_m_s) faults |= bit(Fault::over_speed);
  if (!in.inside_workspace) faults |= bit(Fault::outside_workspace);
  if (norm(state.mode == Mode::direct ? in.direct_force_N : in.force_N) > limits.force_fault_N)
    faults |= bit(Fault::force_implausible);
  if (state.missed_deadline_level > limits.missed_deadline_bucket) faults |= bit(Fault::deadline_missed);
  if (state.energy_J > (state.mode == Mode::direct ? limits.direct_energy_J : limits.energy_J))
    faults |= bit(Fault::energy_created);
  if (state.tracking_ticks >= limits.current_tracking_ticks) faults |= bit(Fault::current_tracking);
  return faults;
}

void count_over_current(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  bool over = false;
  for (std::size_t i = 0; i < 3; ++i) {
    over =
        over || std::fabs(in.measured_current_A[i]) > limits.motor_current_A[i] * limits.over_current_ratio;
  }
  state.over_current_ticks = over ? saturating_add(state.over_current_ticks, in.elapsed_ticks) : 0;
}

// Outputs were on since the last tick: what is measured belongs to its set-points.
void count_tracking(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  const bool strays = outputs_on(state.mode) && in.current_error_A > limits.current_tracking_A;
  state.tracking_ticks = strays ? saturating_add(state.tracking_ticks, in.elapsed_ticks) : 0;
}

void count_deadlines(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  std::uint32_t level = state.missed_deadline_level;
  level = level > in.elapsed_ticks ? level - in.elapsed_ticks : 0;
  // Beyond one bucket above the limit more makes no difference; it only keeps the sum from wrapping.
  const std::uint32_t full = 2 * limits.missed_deadline_bucket;
  const std::uint32_t missed = in.missed_deadlines < full ? in.missed_deadlines : full;
  level += missed * limits.missed_deadline_weight;
  state.missed_deadline_level = level < full ? level : full;
}

// The hand has felt -force_N of the last tick on the way from there; without outputs that was no force, and
// the bucket is empty. It is so, too, after a step that is no number, which is a fault.
void count_energy(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  const float level_J = state.energy_J - dot(state.force_N, in.tip_step_m) -
                        limits.energy_leak_W * kTick_s * static_cast<float>(in.elapsed_ticks);
  state.energy_J = level_J > 0.0f ? level_J : 0.0f;
}

// A program's force is its own affair: it may lead the hand.
void observe_passivity(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  if (state.mode != Mode::render || !is_finite(in.tip_step_m)) return;
  // Of a force that rises, or was lost and damped, the hand has not felt what the model corrects.
  const bool is_felt = !state.force_was_lost && state.soft_start_ticks >= limits.soft_start_ticks;
  state.passivity = observe(state.passivity,
                            {.force_N = state.force_N,
                             .step_m = in.tip_step_m,
                             .correction_J = is_felt ? in.correction_J : 0.0f,
                             .touches = !(in.force_N == Vec3f{})},
                            passivity_limits(limits));
}

// The model in use is that of a tip that is far from the body: it has no force, and does not grow old.
bool says_nothing_is_near(const SupervisorInputs& in) {
  return in.model_sequence != 0 && in.model_valid_ticks == 0;
}

// The model in use is as new as the host means its models to be. What says that nothing is near has no force
// to grow.
bool may_grow(const SupervisorInputs& in) {
  return in.model_sequence != 0 && in.model_valid_ticks != 0 && in.model_use_ticks <= in.model_growth_ticks;
}

// The force that the mode asks for, and its limits.
struct Wanted {
  bool present;
  Vec3f force_N;
  float peak_N;
  float step_N;   // per tick
  float grown_N;  // it may not grow beyond
  // Held so long, then faded to zero.
  std::uint32_t age_ticks;
  std::uint32_t hold_ticks;
  std::uint32_t fade_ticks;
};

Wanted wanted_force(const SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  if (state.mode == Mode::direct) {
    return {.present = in.direct_age_ticks != UINT32_MAX,
            .force_N = in.direct_force_N,
            .peak_N = limits.direct_force_N,
            .step_N = limits.direct_force_step_N,
            .grown_N = limits.direct_force_N,
            .age_ticks = in.direct_age_ticks,
            .hold_ticks = limits.direct_hold_ticks,
            .fade_ticks = limits.direct_fade_ticks};
  }
  const std::uint32_t horizon =
      in.model_valid_ticks < limits.model_horizon_ticks ? in.model_valid_ticks : limits.model_horizon_ticks;
  // That nothing is near is fresh of a host that has just said it: after a silence it has to say it again.
  const bool nothing = says_nothing_is_near(in);
  return {.present = in.model_sequence != 0,
          .force_N = in.force_N,
          .peak_N = limits.peak_force_N,
          .step_N = limits.force_step_N,
          .grown_N = may_grow(in) ? limits.peak_force_N : std::max(state.grown_N, limits.force_step_N),
          .age_ticks = in.model_age_ticks,
          .hold_ticks = nothing ? limits.link_silent_ticks : horizon,
          .fade_ticks = nothing ? 0 : limits.model_fade_ticks};
}

bool is_fresh(const Wanted& wanted) {
  return wanted.present && wanted.age_ticks <= wanted.hold_ticks;
}

bool has_faded(const Wanted& wanted) {
  return !wanted.present ||
         (wanted.age_ticks > wanted.hold_ticks && wanted.age_ticks - wanted.hold_ticks >= wanted.fade_ticks);
}

// How much of it is rendered, 0 to 1: soft start after arming and after a lost link, which waits while the
// force is lost; fading when it is old.
float force_scale(const SupervisorState& state, const Wanted& wanted, const Limits& limits) {
  float scale = 1.0f;
  if (state.soft_start_ticks < limits.soft_start_ticks) {
    scale = static_cast<float>(state.soft_start_ticks) / static_cast<float>(limits.soft_start_ticks);
  }
  if (wanted.age_ticks > wanted.hold_ticks) {
    const std::uint32_t over = wanted.age_ticks - wanted.hold_ticks;
    const float fade = over < wanted.fade_ticks
                           ? 1.0f - static_cast<float>(over) / static_cast<float>(wanted.fade_ticks)
                           : 0.0f;
    scale *= fade;
  }
  return scale;
}

bool is_silent(const SupervisorInputs& in, const Limits& limits) {
  return in.link_age_ticks > limits.link_silent_ticks;
}

// Of Mode::render: the tip is damped, for its model has faded. Without a model, or with one that says that
// nothing is near, only while the host is silent: one that is heard owes none.
bool is_cut_off(const SupervisorInputs& in, const Limits& limits, const Wanted& wanted) {
  const bool owes_a_model = wanted.present && !says_nothing_is_near(in);
  return has_faded(wanted) && (owes_a_model || is_silent(in, limits));
}

// Against the tip's motion: the hand feels the opposite.
Vec3f damping_force(const SupervisorInputs& in, const Limits& limits) {
  return shortened(limits.damping_N_s_m * in.tip_velocity_m_s, limits.damping_force_N);
}

// Before the limit of its change.
Vec3f asked_force(const SupervisorState& state, const SupervisorInputs& in, const Limits& limits,
                  const Wanted& wanted) {
  if (state.damping_ticks > 0 && is_cut_off(in, limits, wanted)) return damping_force(in, limits);
  if (!wanted.present) return {};
  // Exactly the force that was asked for where nothing limits it, so that the record can tell by comparing.
  const Vec3f force_N = shortened(wanted.force_N, wanted.peak_N);
  const float scale = force_scale(state, wanted, limits);
  return shortened(force_N * scale, wanted.grown_N);
}

Vec3f towards(const Vec3f& asked_N, const SupervisorState& state, const SupervisorInputs& in,
              const Wanted& wanted) {
  const Vec3f change_N = asked_N - state.force_N;
  const float step_N = norm(change_N);
  const float largest_N = wanted.step_N * static_cast<float>(in.elapsed_ticks);
  return step_N > largest_N ? state.force_N + change_N * (largest_N / step_N) : asked_N;
}

// With the passivity controller's damping, of which `state` remembers what the limits have left.
Vec3f limited_force(SupervisorState& state, const SupervisorInputs& in, const Limits& limits,
                    const Wanted& wanted) {
  const Vec3f asked_N = asked_force(state, in, limits, wanted);
  const Vec3f force_N = towards(asked_N, state, in, wanted);
  state.passivity.damping_N = {};
  if (state.damping_ticks > 0) return force_N;
  const Vec3f damping_N =
      passivity_damping(state.passivity, in.tip_velocity_m_s, kTick_s, passivity_limits(limits));
  if (damping_N == Vec3f{}) return force_N;
  const Vec3f damped_N = towards(shortened(asked_N + damping_N, wanted.peak_N), state, in, wanted);
  state.passivity.damping_N = damped_N - force_N;
  return damped_N;
}

// `always` and `rendering` are the conditions of this tick: both refuse arming; those that only matter while
// rendering stand neither in the way of CLEAR_FAULT nor of a calibration, which may be their cure.
Status run_command(SupervisorState& state, const SupervisorInputs& in, FaultSet always, FaultSet rendering,
                   std::uint32_t seed, bool& calibration_begins) {
  const bool may_arm = state.mode == Mode::idle && always == 0 && rendering == 0 && state.position_trusted;
  switch (in.command.action) {
    case Action::nothing:
    case Action::stop:  // already among the conditions
      return Status::ok;
    case Action::disarm:
      if (is_armed(state.mode)) enter(state, Mode::idle);
      state.token = 0;
      return Status::ok;
    case Action::arm_request:
    case Action::arm_direct:
      if (!may_arm) return Status::command_refused;
      state.token_is_direct = in.command.action == Action::arm_direct;
      state.token_node = in.command_node;
      state.token = make_token(in.tick, seed);
      state.token_age_ticks = 0;
      return Status::ok;
    case Action::arm_confirm: {
      if (!may_arm) return Status::command_refused;
      // The token stands in the status, for everybody to read: it is no try, and the challenge stays open.
      if (state.token != 0 && in.command_node != state.token_node) return Status::command_refused;
      // One that is too old has been closed at the beginning of the tick.
      const bool right = state.token != 0 && in.command.token == state.token;
      state.token = 0;  // one try a challenge
      if (!right) return Status::command_token_wrong;
      enter(state, state.token_is_direct ? Mode::direct : Mode::render);
      return Status::ok;
    }
    case Action::calibrate:
      if (state.mode != Mode::idle || always != 0 || !in.at_rest) return Status::command_refused;
      enter(state, Mode::calibrate);
      calibration_begins = true;
      return Status::ok;
    case Action::clear_fault:
      if (state.mode != Mode::fault) return Status::ok;  // nothing to clear
      if (always != 0) return Status::command_refused;
      state.faults = 0;
      enter(state, Mode::idle);
      return Status::ok;
  }
  return Status::command_refused;  // a number that is no action
}

// Heard for the last time too long ago, or heard since and without a model for as long.
bool is_lost(const SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  return in.link_age_ticks > limits.link_lost_ticks || state.mode_age_ticks > limits.link_lost_ticks;
}

// A model has come after one whose force was not to grow any more, or after none: what has grown meanwhile is
// not met within a few ticks, but by the soft start, from the force of the last tick on.
void start_from_last_force(SupervisorState& state, const SupervisorInputs& in, const Limits& limits) {
  const float last_N = std::max(norm(state.force_N), limits.force_step_N);
  const float asked_N = norm(in.force_N);
  if (!(asked_N > last_N)) return;
  const auto from_ticks =
      static_cast<std::uint32_t>(static_cast<float>(limits.soft_start_ticks) * (last_N / asked_N));
  state.soft_start_ticks = std::min(state.soft_start_ticks, from_ticks);
}

// How far the force may go once the model has been in use for too long: no farther than it went until then.
// What begins to be touched afterwards is felt with up to what no fault is felt with more in one tick.
void follow_growth(SupervisorState& state, const SupervisorInputs& in) {
  if (state.mode != Mode::render) return;
  const bool has_force = in.model_sequence != 0 && in.model_valid_ticks != 0;
  state.growth_had_ended = !may_grow(in);
  if (!state.growth_had_ended || !has_force) state.grown_N = norm(state.force_N - state.passivity.damping_N);
}

// What a stale model or a silent link does to rendering: damped, off, and on again when the host that armed
// is heard and has sent a model. `rendering` as for arming: outputs do not come on while one of these lasts.
// Only a fresh model ends the count of damping, or a host that is heard and owes none: signs of life alone do
// not keep outputs on for ever. The force comes back with a model that has one.
void follow_models(SupervisorState& state, const SupervisorInputs& in, const Limits& limits,
                   FaultSet rendering) {
  const Wanted wanted = wanted_force(state, in, limits);
  const bool nothing_is_near = says_nothing_is_near(in);
  if (state.mode == Mode::render) {
    if (state.growth_had_ended && may_grow(in)) start_from_last_force(state, in, limits);
    if (is_cut_off(in, limits, wanted)) {
      state.force_was_lost = true;
      state.soft_start_ticks = 0;
      state.damping_ticks = saturating_add(state.damping_ticks, in.elapsed_ticks);
      if (state.damping_ticks > limits.damping_ticks) enter(state, Mode::suspended);
      return;
    }
    if (is_fresh(wanted) || nothing_is_near) state.damping_ticks = 0;
    if (is_fresh(wanted) && !nothing_is_near) state.force_was_lost = false;
  } else if (state.mode == Mode::suspended && !is_silent(in, limits) && is_fresh(wanted) && rendering == 0 &&
             !is_lost(state, in, limits)) {
    enter(state, Mode::render);
    state.force_was_lost = nothing_is_near;
  }
}

}  // namespace

Decision supervise(const SupervisorState& previous, const SupervisorInputs& in, const Limits& limits,
                   std::uint32_t challenge_seed) {
  Decision decision;
  SupervisorState& state = decision.state;
  state = previous;
  state.mode_age_ticks = saturating_add(state.mode_age_ticks, in.elapsed_ticks);
  if (state.token != 0) {
    state.token_age_ticks = saturating_add(state.token_age_ticks, in.elapsed_ticks);
    if (state.token_age_ticks > limits.arming_window_ticks) state.token = 0;
  }
  count_over_current(state, in, limits);
  count_tracking(state, in, limits);
  count_deadlines(state, in, limits);
  count_energy(state, in, limits);
  observe_passivity(state, in, limits);
  if (outputs_on(state.mode) && !state.force_was_lost)
    state.soft_start_ticks = saturating_add(state.soft_start_ticks, in.elapsed_ticks);

  const FaultSet always = faults_always(state, in, limits);
  const FaultSet rendering = faults_of_rendering(state, in, limits);
  if ((always & bit(Fault::encoder_jump)) != 0) state.position_trusted = false;

  if (state.mode == Mode::boot && state.mode_age_ticks >= limits.boot_ticks) enter(state, Mode::idle);
  if (state.mode == Mode::calibrate) {
    if (!in.at_rest) {
      enter(state, Mode::idle);  // it moved: the old zero stays
    } else if (state.mode_age_ticks >= limits.calibration_ticks) {
      enter(state, Mode::idle);
      state.position_trusted = true;
      decision.calibration_ends = true;
    }
  }

  // The program that was to send forces has gone.
  if (state.mode == Mode::direct && state.mode_age_ticks > limits.direct_lost_ticks &&
      in.direct_age_ticks > limits.direct_lost_ticks)
    enter(state, Mode::idle);

  follow_models(state, in, limits, rendering);

  decision.outcome.action = in.command.action;
  decision.outcome.status =
      run_command(state, in, always, rendering, challenge_seed, decision.calibration_begins);

  FaultSet present = static_cast<FaultSet>(outputs_on(state.mode) ? always | rendering : always);
  if (state.mode == Mode::suspended && is_lost(state, in, limits)) present |= bit(Fault::link_lost);
  if (present != 0) {
    if (state.mode != Mode::fault) enter(state, Mode::fault);
    state.faults = static_cast<FaultSet>(state.faults | present);
    decision.calibration_ends = false;  // none begins: that would have been refused
  }

  decision.outputs_on = outputs_on(state.mode);
  const Wanted wanted = wanted_force(state, in, limits);
  state.force_N = decision.outputs_on ? limited_force(state, in, limits, wanted) : Vec3f{};
  follow_growth(state, in);
  decision.force_limited = decision.outputs_on && !(state.force_N == wanted.force_N);
  decision.outcome.token = state.token;
  return decision;
}

Decision trip(Decision decision, Fault fault) {
  SupervisorState& state = decision.state;
  if (state.mode != Mode::fault) enter(state, Mode::fault);
  state.faults = static_cast<FaultSet>(state.faults | bit(fault));
  state.force_N = {};
  decision.outputs_on = false;
  decision.force_limited = false;
  decision.calibration_begins = false;
  decision.calibration_ends = false;
  decision.outcome.token = 0;
  return decision;
}

CurrentLimit limit_currents(const std::array<float, 3>& wanted_A, const std::array<float, 3>& largest_A) {
  CurrentLimit result;
  if (!finite(wanted_A)) {
    result.finite = false;
    return result;
  }
  float scale = 1.0f;
  // Of a current of 0 it is infinity.
  for (std::size_t i = 0; i < 3; ++i) scale = std::min(scale, largest_A[i] / std::fabs(wanted_A[i]));
  result.limited = scale != 1.0f;
  for (std::size_t i = 0; i < 3; ++i) result.setpoint_A[i] = wanted_A[i] * scale;
  return result;
}

}  // namespace palpate::firmware
