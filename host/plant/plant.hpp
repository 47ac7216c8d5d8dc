// The simulated device in a simulated hand: what the firmware would find at its encoders and amplifiers.
//
// Arm and hand are integrated together by the classical fourth-order Runge-Kutta method with a fixed substep;
// the amplifiers' currents enter in closed form. With the default parameters the fastest part (smoothed
// friction, see ArmParameters) has a time constant of 0.5 ms: steps of 50 us are far inside the method's
// stability.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "host/plant/amplifiers.hpp"
#include "host/plant/arm_plant.hpp"
#include "host/plant/hand.hpp"
#include "host/plant/tip_path.hpp"
#include "shared/device/encoders.hpp"
#include "shared/math/linear.hpp"

namespace palpate::plant {

// What moves the tip.
enum class HandKind {
  impedance,  // a hand that follows the path and holds the tool (hand.hpp)
  // The tip is where the path is, whatever the motors do: the programmed motion of Jacobs, Fu, Cavusoglu
  // 2010, section 5.1.
  scripted,
  // The tip is where it was in an earlier run, and the board reads what it read then (RecordedMotion).
  recorded,
};

// What a board read and where the tip was in each servo tick of an earlier run, from tick 0 on; then the last
// one.
struct RecordedMotion {
  std::vector<device::EncoderCounts> encoder_count;
  std::vector<Vec3d> tip_m;  // device frame
};

struct PlantParameters {
  HandKind hand_kind = HandKind::impedance;
  ArmParameters arm{};
  AmplifierParameters amplifiers{};
  HandParameters hand{};                      // impedance only
  double grip = 1.0;                          // at the start; impedance only
  device::EncoderCounts encoder_reference{};  // what the encoders read in the reference pose
  double substep_s = 50e-6;                   // at most
};

// One thread. Lengths in the device frame. Equal calls give equal bits on one machine (libm decides across
// machines).
class Plant {
 public:
  // At time 0, at rest, the tip where the path has it at time 0, held there by the hand. Throws
  // std::invalid_argument for parameters out of range and for a start outside the arm's workspace.
  Plant(const PlantParameters& parameters, TipPath intended);
  // Of the kind `recorded`; parameters.hand_kind is what moved the tip then. Only the motors' currents are
  // simulated, in the steps of then: a board that gives the set-points of then reads the currents of then, to
  // the bit. Throws std::invalid_argument for parameters out of range, for no tick, or for other than as many
  // positions as counts.
  Plant(const PlantParameters& parameters, RecordedMotion recorded);

  // Lets duration_s > 0 pass, usually one servo tick, with constant set-points; enabled false means no
  // current. Throws std::invalid_argument for set-points that are not finite, a duration out of range, or a
  // scripted path that leaves the arm's workspace, and std::runtime_error when the state stops being finite.
  void advance(const std::array<float, 3>& setpoint_A, bool enabled, double duration_s);

  // From now on the hand intends to be at this point, which goes on at its velocity until the next call; the
  // path does not count any more. Throws std::invalid_argument for a point that is not finite and for a hand
  // of another kind than impedance.
  void guide(const PathPoint& intended);

  // grip in [0, 1], from now on; throws std::invalid_argument. Without effect on a scripted tip.
  void set_grip(double grip);

  [[nodiscard]] double time_s() const { return time_s_; }
  // What a board reads.
  [[nodiscard]] device::EncoderCounts encoder_counts() const;
  [[nodiscard]] std::array<float, 3> measured_current_A() const;
  // The truth behind it; of a recorded motion the joints are not known.
  [[nodiscard]] const Vec3d& joint_rad() const { return state_.joint_rad; }
  [[nodiscard]] const Vec3d& joint_rad_s() const { return state_.joint_rad_s; }
  [[nodiscard]] Vec3d tip_position_m() const;
  [[nodiscard]] Vec3d tip_velocity_m_s() const {
    return arm_.jacobian_m(state_.joint_rad) * state_.joint_rad_s;
  }
  [[nodiscard]] const Vec3d& hand_position_m() const { return state_.hand.position_m; }
  // Recorded: where the tip was.
  [[nodiscard]] Vec3d intended_position_m() const;
  // Of the hand on the tool; the hand feels the opposite. Scripted: the force that it takes to hold the tip
  // on the path against the arm's inertia, weight and friction and the motors, with the joints' mean
  // acceleration since the call of advance() before. Recorded: NaN, nobody holds it.
  [[nodiscard]] Vec3d hand_force_N() const;
  [[nodiscard]] double grip() const { return grip_; }
  [[nodiscard]] const ArmPlant& arm() const { return arm_; }

 private:
  struct State {
    Vec3d joint_rad{}, joint_rad_s{};
    HandState hand{};
  };
  [[nodiscard]] State derivative(const State& state, double delay_s) const;
  void substep(double step_s);
  void integrate(double duration_s);
  void follow_script(double duration_s);
  void go_on_in_record(double duration_s);
  [[nodiscard]] PathPoint intended(double time_s) const;
  [[nodiscard]] std::size_t recorded_tick() const;

  HandKind hand_kind_;
  ArmPlant arm_;
  Amplifiers amplifiers_;
  Hand hand_;
  TipPath intended_;
  device::EncoderCounts encoder_reference_;
  double substep_s_;
  double grip_ = 0.0;
  double time_s_ = 0.0;
  State state_{};
  Vec3d joint_rad_s2_{};  // scripted: mean over the last advance()
  RecordedMotion recorded_{};
  std::optional<PathPoint> guide_;
  double guided_at_s_ = 0.0;
};

}  // namespace palpate::plant
