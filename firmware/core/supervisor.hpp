// The safety supervisor: decides in every servo tick whether the outputs may be on and what force may be
// rendered.
//
// A pure function of state, inputs and limits: no clock, no hardware, no memory of its own, so that tests can
// walk through every state (docs/safety.md has the rules in words).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/core/passivity.hpp"
#include "shared/math/linear.hpp"
#include "shared/status.hpp"

namespace palpate::firmware {

// palpate.BoardStatus MODE_*: values travel over the link, never renumber them.
enum class Mode : std::uint8_t {
  boot = 0,       // outputs off; the first ticks after reset
  idle = 1,       // outputs off; sensors read, trace sent
  calibrate = 2,  // outputs off; the encoder zero is being set
  render = 3,     // outputs on
  fault = 4,      // outputs off, latched until CLEAR_FAULT
  direct = 5,     // outputs on, with the force of palpate.DirectForce in place of a model's
  suspended = 6,  // outputs off: link or models are lost; goes on by itself when they return in time
};
inline constexpr std::size_t kModes = 7;

constexpr bool outputs_on(Mode mode) {
  return mode == Mode::render || mode == Mode::direct;
}

// The handshake of arming holds: outputs are on, or may come on without another one.
constexpr bool is_armed(Mode mode) {
  return outputs_on(mode) || mode == Mode::suspended;
}

// Reasons to switch off, bits of BoardStatus.faults: they add up until CLEAR_FAULT. Never renumber them.
enum class Fault : std::uint16_t {
  none = 0,
  emergency_stop = 1u << 0,     // the chain is open
  stop_command = 1u << 1,       // palpate.Command STOP
  not_a_number = 1u << 2,       // NaN or infinity in tip, force, current or torque
  encoder_jump = 1u << 3,       // a joint moved further in one tick than a hand can move it
  over_speed = 1u << 4,         // the tip, while outputs were on
  outside_workspace = 1u << 5,  // the tip, while outputs were on
  over_current = 1u << 6,       // measured by an amplifier
  force_implausible = 1u << 7,  // the model asked for far more than any contact can
  deadline_missed = 1u << 8,    // too many servo ticks came late, while outputs were on
  link_lost = 1u << 9,          // the host that armed has been silent for too long
  energy_created = 1u << 10,    // the force has given the hand more than what it stands for can hold
  motor_heat = 1u << 11,        // a motor goes on heating beyond what the folded currents allow
  current_tracking = 1u << 12,  // an amplifier does not follow its set-point, while outputs were on
  supply_low = 1u << 13,        // of the board's own electronics
};

using FaultSet = std::uint16_t;
constexpr FaultSet bit(Fault fault) {
  return static_cast<FaultSet>(fault);
}

// palpate.Command: values travel over the link.
enum class Action : std::uint8_t {
  nothing = 0,
  arm_request = 1,
  arm_confirm = 2,
  disarm = 3,
  calibrate = 4,
  clear_fault = 5,
  stop = 6,
  arm_direct = 7,
};

struct Command {
  Action action = Action::nothing;
  std::uint32_t token = 0;  // only with arm_confirm
};

// Limits of the supervisor. Defaults are for a PHANTOM 1.5-class arm (shared/device/parameters.hpp);
// docs/safety.md lists them with what happens at each.
struct Limits {
  // Encoder and current readings have settled after reset.
  std::uint32_t boot_ticks = 20;
  // A forgotten challenge of arming does not stay open (palpate.Command).
  std::uint32_t arming_window_ticks = 1000;
  // A hand needs some 150 ms to react: the force must not step when the tip is in contact at arming.
  std::uint32_t soft_start_ticks = 100;

  // Peak force of the device.
  float peak_force_N = 8.5f;
  // Largest change per tick, whatever the model asks for: 8.5 N in 17 ms, and no fault of the link is felt as
  // more than that. The reference body, 318 N/m stiff, asks for 0.03 N at 0.1 m/s
  // (docs/decisions/link_loss.md).
  float force_step_N = 0.5f;
  // Twelve times the peak: no hand presses so hard; a model that diverges passes it at once.
  float force_fault_N = 100.0f;

  // Upper bound of a local model's horizon, whatever it claims itself: a second of a lost link.
  std::uint32_t model_horizon_ticks = 1000;
  // Beyond the horizon its force fades to zero: slowly enough to feel as weakening, not as a drop.
  std::uint32_t model_fade_ticks = 200;

  // The host that armed says something every 100 ticks at least (docs/protocol.md): two may be lost.
  std::uint32_t link_silent_ticks = 300;
  // Once its model has faded the tip is only damped: half of what a tip of 0.03 kg takes before
  // it swings (docs/safety.md has the derivation), and no more than a hand notices as a drag.
  float damping_N_s_m = 2.0f;
  float damping_force_N = 1.0f;
  // Then outputs go off. The arm swings less than a tenth of a second at that damping; the hand has time to
  // take over its weight.
  std::uint32_t damping_ticks = 1000;
  // A link that has been lost for longer, or has not brought a model for longer since outputs went off, does
  // not bring the force back by itself.
  std::uint32_t link_lost_ticks = 10'000;

  // A leaking bucket of what the model's force gives the hand, less what it takes. A spring pressed to 8.5 N
  // over 10 cm, four times the reference body's 2.7, gives back 0.43 J; a body that moves by itself may give
  // 0.5 W for ever.
  float energy_J = 0.5f;
  float energy_leak_W = 0.5f;

  // Of the passivity controller, which damps as a lost link does: what the force has created is let be up to
  // this. Below half of what a hand can notice at all, 1 mJ: 0.1 N over 1 cm.
  float passivity_allowance_J = 0.5e-3f;
  // More is forgotten: half a second of that damping at 0.1 m/s.
  float passivity_most_J = 10e-3f;

  // Of palpate.DirectForce. Any program may send one, so the limits are closer than a model's: 5 N still
  // stops a hand, and a wall of 1 kN/m met at 0.5 m/s asks for 0.5 N more in each tick.
  float direct_force_N = 5.0f;
  float direct_force_step_N = 0.5f;
  // As energy_J, with the same leak. No field of forces that gives back only what it took can give more than
  // 5 N over the 0.71 m between the farthest places of the arm's workspace: 3.5 J (docs/safety.md).
  float direct_energy_J = 4.0f;
  // A program at 1 kHz that the operating system delays; then the force fades.
  std::uint32_t direct_hold_ticks = 20;
  std::uint32_t direct_fade_ticks = 50;
  // A program that has gone: outputs go off, and the next one has to arm.
  std::uint32_t direct_lost_ticks = 1000;

  // Per tick: 50 rad/s, 10 m/s at the tip. No hand does that; a broken encoder or cable does.
  float joint_step_rad = 0.05f;
  // At peak force the arm alone (0.03 to 0.08 kg) reaches it within 1 to 3 cm; strokes of a hand stay
  // below 1.5.
  float tip_speed_m_s = 2.5f;
  // Rest before a calibration counts; flicker of one count on a joint is rest.
  std::uint32_t calibration_ticks = 100;
  std::int32_t calibration_motion_count = 1;

  // Set-points. 8.5 N at the reference pose take 6.97 A.
  std::array<float, 3> motor_current_A{7.0f, 7.0f, 7.0f};
  // Measured current, relative to the above and for as many ticks in a row: overshoot of the amplifier is
  // less.
  float over_current_ratio = 1.5f;
  std::uint32_t over_current_ticks = 5;

  // Measured current less the set-point that it belongs to, for as many ticks in a row, while outputs are on.
  // Within 0.5 N a tick a set-point moves by 0.73 A at most: an amplifier of 150 Hz lags that by 0.47 A;
  // set-point and monitor may be wrong by 5 % of 7 A each (docs/safety.md).
  float current_tracking_A = 1.5f;
  std::uint32_t current_tracking_ticks = 10;

  // Of the motors' heat (motor_heat.hpp; docs/sources.md has where the numbers come from): the current that
  // they bear for ever, what share of the heat is the winding's above its housing, and the time constants of
  // both.
  std::array<float, 3> motor_continuous_A{1.24f, 1.24f, 1.24f};
  float winding_share = 0.25f;
  float winding_s = 12.0f;
  float housing_s = 900.0f;
  // Of heat, which is 1 at the highest temperature of a winding: from here on the largest currents fold back
  // to the continuous ones, which they are at 1. 8 N last 1.4 s until then.
  float heat_fold = 0.8f;
  // Folded currents never lead here: something else heats.
  float heat_fault = 1.1f;
  // Of windings and housings, where nothing is known of before: 0 cold, 1 as warm as the continuous current
  // makes them.
  float heat_at_start = 0.0f;

  // A bucket that each missed deadline fills and each tick drains by one. It runs over at the sixth missed
  // within half a second: by then the force belongs to where the tip was.
  std::uint32_t missed_deadline_weight = 100;
  std::uint32_t missed_deadline_bucket = 500;
};

// In flash: a board that sets none needs no copy on its stack.
inline constexpr Limits kDefaultLimits{};

// Supervisor state; one writer, the servo interrupt. Everything about time is an age, so states can be
// compared.
struct SupervisorState {
  Mode mode = Mode::boot;
  FaultSet faults = 0;
  std::uint32_t mode_age_ticks = 0;  // since the mode was entered
  std::uint32_t token = 0;           // open challenge of arming; 0: none
  std::uint32_t token_age_ticks = 0;
  bool token_is_direct = false;             // to Mode::direct, not to Mode::render
  std::uint16_t token_node = 0;             // that asked for it
  std::uint32_t over_current_ticks = 0;     // in a row
  std::uint32_t tracking_ticks = 0;         // likewise
  std::uint32_t missed_deadline_level = 0;  // the bucket
  bool position_trusted = true;             // false after an encoder jump, until a calibration
  Vec3f force_N{};                          // as rendered in the last tick
  bool force_was_lost = false;              // no force before a fresh model, and that from zero
  bool growth_had_ended = false;            // of the force of the model in use
  float grown_N = 0.0f;                     // as far as that force may go
  std::uint32_t soft_start_ticks = 0;       // since the force began to rise
  std::uint32_t damping_ticks = 0;          // since the newest fresh model
  float energy_J = 0.0f;                    // the bucket
  PassivityState passivity{};               // of a model's force

  friend bool operator==(const SupervisorState&, const SupervisorState&) = default;
};

// What one tick brings.
struct SupervisorInputs {
  std::uint32_t tick = 0;
  std::uint32_t elapsed_ticks = 1;     // since the last call; more than 1 after lost ticks
  std::uint32_t missed_deadlines = 0;  // since the last call
  bool emergency_stop_open = false;
  bool supply_low = false;
  Command command{};               // at most one per tick
  std::uint16_t command_node = 0;  // that sent it
  // Sensors and kinematics.
  Vec3f tip_m{};             // device frame
  float joint_step_rad = 0;  // largest change of a joint since the last call, per elapsed tick
  float tip_speed_m_s = 0;
  bool inside_workspace = true;
  bool at_rest = true;  // no joint moved by more than calibration_motion_count since calibration began
  std::array<float, 3> measured_current_A{};
  float current_error_A = 0;  // the largest difference from the set-point that it belongs to
  float hottest_motor = 0;    // heat (motor_heat.hpp): 1 is the highest temperature of a winding
  Vec3f tip_step_m{};         // since the last call; zero where it is not known
  Vec3f tip_velocity_m_s{};   // estimated between counts; zero where nothing asks for it
  // Since the host that armed was heard.
  std::uint32_t link_age_ticks = 0;
  // Local model.
  Vec3f force_N{};                   // of the tip on the body as the model asks for it
  std::uint32_t model_sequence = 0;  // 0: no model
  std::uint32_t model_age_ticks = 0;
  std::uint32_t model_valid_ticks = 0;  // its own horizon; 0: it says that nothing is near the tip
  // Its force may grow for so many ticks after it was taken over.
  std::uint32_t model_growth_ticks = 0;
  std::uint32_t model_use_ticks = 0;  // since it was taken over
  float correction_J = 0.0f;          // given too much by what was rendered before it was taken over
  // palpate.DirectForce, as a force of the tip on the body: the hand feels the opposite.
  Vec3f direct_force_N{};
  std::uint32_t direct_age_ticks = UINT32_MAX;  // of the newest; UINT32_MAX: none has come
};

[[nodiscard]] inline PassivityLimits passivity_limits(const Limits& limits) {
  return {limits.passivity_allowance_J, limits.passivity_most_J, limits.damping_N_s_m,
          limits.damping_force_N};
}

struct CommandOutcome {
  Action action = Action::nothing;  // nothing: there was no command
  Status status = Status::ok;
  std::uint32_t token = 0;  // challenge that is open now
};

// What the tick is to do.
struct Decision {
  SupervisorState state{};  // to be passed to the next call
  bool outputs_on = false;
  bool force_limited = false;       // the force below is not the model's
  bool calibration_begins = false;  // remember the present counts
  bool calibration_ends = false;    // the present pose becomes the reference pose
  CommandOutcome outcome{};
};

// One servo tick. Outputs are on only in Mode::render and Mode::direct, and only ARM_CONFIRM with the token
// of a challenge that is at most limits.arming_window_ticks old leads there, but for one exception: from
// Mode::suspended, into which only Mode::render leads, back to it. Every fault that this tick shows is in the
// decision of this tick. `challenge_seed` makes tokens differ between boards and boots.
Decision supervise(const SupervisorState& state, const SupervisorInputs& inputs, const Limits& limits,
                   std::uint32_t challenge_seed);

// The decision with `fault` latched and outputs off: for what shows only after supervise(), within the same
// tick.
Decision trip(Decision decision, Fault fault);

// Set-points within the largest ones. All three shrink by one factor, so the force keeps its direction.
// Returns false, and zeros, when one is not finite.
struct CurrentLimit {
  std::array<float, 3> setpoint_A{};
  bool limited = false;
  bool finite = true;
};
CurrentLimit limit_currents(const std::array<float, 3>& wanted_A, const std::array<float, 3>& largest_A);

}  // namespace palpate::firmware
