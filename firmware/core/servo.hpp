// The servo tick, without hardware: encoder counts in, motor current set-points out.
//
// counts -> joint angles -> tip (shared/device) -> force of the local model (Renderer) -> supervisor
//        The supervisor sees the tip of the counts; the renderer that one or an estimate between counts
//        (count_estimator), as the active model asks for.
//        -> joint torques that push the tip with the opposite force, plus gravity -> motor currents.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "firmware/core/mailbox.hpp"
#include "firmware/core/motor_heat.hpp"
#include "firmware/core/renderer.hpp"
#include "firmware/core/supervisor.hpp"
#include "shared/device/arm.hpp"
#include "shared/device/count_estimator.hpp"
#include "shared/device/encoders.hpp"
#include "shared/device/parameters.hpp"

namespace palpate::firmware {

// BoardStatus is sent this often, and at each change of mode.
inline constexpr std::uint32_t kStatusPeriod_ticks = 100;

struct ServoTiming {
  std::uint32_t tick = 0;
  std::uint32_t elapsed_ticks = 1;         // since the last tick; more than 1 after lost ticks
  std::uint32_t new_missed_deadlines = 0;  // since the last tick
  std::uint32_t missed_deadlines = 0;      // so far
  std::uint32_t worst_tick_count = 0;      // so far
};

struct ServoSensors {
  device::EncoderCounts count{};
  std::array<float, 3> measured_current_A{};
  bool emergency_stop_open = false;
  bool supply_low = false;
};

struct ServoOutput {
  bool outputs_on = false;
  std::array<float, 3> setpoint_A{};  // zeros while outputs are off
  Vec3f force_N{};                    // of the tip on the body, after limits
  Mode mode = Mode::boot;
  FaultSet faults = 0;
  ServoSample sample{};  // as it stands in the history
};

// Set-points of the motors that make the tip push with -force_N against the hand, the reaction to the force
// of the tip on the body, carry the arm's weight, and take over `friction_N_m` of its joints. Any context.
CurrentLimit reaction_currents(const device::Parameters& device, const device::Pose& pose,
                               const Vec3f& force_N, const std::array<float, 3>& largest_A,
                               const Vec3f& friction_N_m = {});

class Servo {
 public:
  // The counts of the reference pose are taken as 0 until a calibration. `challenge_seed` as in supervise().
  Servo(const device::Parameters& device, const Limits& limits, std::uint32_t challenge_seed,
        Renderer& renderer, Mailbox& mailbox)
      : device_(device),
        limits_(limits),
        challenge_seed_(challenge_seed),
        renderer_(renderer),
        mailbox_(mailbox),
        heat_(heat_at_start(limits)) {}

  // Before the first tick: what the board has kept.
  void begin(const Tuning& tuning) { use(tuning); }
  void begin(const MotorHeat& heat) { heat_ = heat; }

  // Interrupt context, once per servo tick. Counts and currents as the board has them; set-points as the
  // amplifiers need them.
  ServoOutput isr_tick(const ServoTiming& timing, const ServoSensors& sensors);

  // Interrupt context.
  [[nodiscard]] const MotorHeat& heat() const { return heat_; }

  // Background context: the tick after the newest one whose sample is complete; 0: none yet.
  [[nodiscard]] std::uint32_t next_tick() const { return next_tick_.load(std::memory_order_acquire); }
  // Background context: the sample of a tick with all its flags, if the history still holds it.
  bool sample(std::uint32_t tick, ServoSample& out) const;

 private:
  void use(const Tuning& tuning);
  [[nodiscard]] float tuned_share(const SupervisorState& state) const;
  [[nodiscard]] std::array<float, 3> largest_currents_A() const;
  [[gnu::noinline]] void take_tuning();
  [[nodiscard]] ServoSensors corrected(const ServoSensors& sensors) const;
  [[gnu::noinline]] void post_sample(const ServoTiming& timing, const ServoSensors& raw,
                                     const ServoSensors& sensors, const Vec3f& joint_rad,
                                     const std::array<float, 3>& setpoint_A);
  SupervisorInputs gather(const ServoTiming& timing, const ServoSensors& sensors, const device::Pose& pose,
                          const ServoSample& sample);
  void update_estimate(const ServoTiming& timing, const ServoSensors& sensors);
  void take_direct_forces(std::uint32_t elapsed_ticks);
  // STOP before DISARM before what waits in the ring; false: nothing of the ring. Either of the two also
  // refuses all that waits there, which may have been sent before it and would undo it.
  bool take_command(CommandRequest& request);
  void listen_to_host(std::uint32_t elapsed_ticks);
  void forget_models();
  void note_who_armed(const Decision& decision, const CommandRequest& request);
  void post_device(const ServoTiming& timing, const device::Pose& pose);
  void post(const ServoTiming& timing, const Decision& decision);
  void record_flags(const ServoTiming& timing, const Decision& decision);

  const device::Parameters& device_;
  const Limits& limits_;
  std::uint32_t challenge_seed_;
  Renderer& renderer_;
  Mailbox& mailbox_;

  // Interrupt's own.
  Tuning tuning_{};
  Vec3f gravity_ratio_{1.0f, 1.0f, 1.0f};  // of the tuning's weight to the device's
  bool compensates_friction_ = false;
  SupervisorState state_{};
  MotorHeat heat_;
  std::array<float, 3> setpoint_A_{};        // of the last tick
  device::EncoderCounts reference_count_{};  // in the reference pose
  device::EncoderCounts previous_count_{};
  device::EncoderCounts rest_count_{};  // at the start of a calibration
  device::CountEstimators estimators_{};
  Vec3f tip_m_{};                                // of the last tick whose pose was known
  Vec3f rendered_tip_m_{};                       // likewise, as the renderer was told it
  Vec3f direct_force_N_{};                       // the newest palpate.DirectForce, of the tip on the body
  std::uint32_t direct_age_ticks_ = UINT32_MAX;  // of it; UINT32_MAX: none has come
  float correction_J_ = 0.0f;                    // as the renderer had it last
  std::uint32_t stops_ = 0, disarms_ = 0;        // as the mailbox had them last
  std::uint32_t host_frames_ = 0;                // as the mailbox had them last
  std::uint32_t link_age_ticks_ = UINT32_MAX;    // since the host that armed was heard
  bool have_counts_ = false;
  bool have_tip_ = false;
  bool status_due_ = true;  // a snapshot that found its ring full is sent later
  std::uint32_t next_status_tick_ = 0;

  // FLAG_RENDERING and FLAG_LIMITED of each tick: known only after the renderer has recorded its sample.
  std::array<std::atomic<std::uint8_t>, kTipHistory> flags_{};
  std::atomic<std::uint32_t> next_tick_{0};
};

}  // namespace palpate::firmware
