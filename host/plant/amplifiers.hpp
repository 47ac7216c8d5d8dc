// The three motor current amplifiers: a first-order lag behind a saturated set-point.
#pragma once

#include "shared/math/linear.hpp"

namespace palpate::plant {

struct AmplifierParameters {
  double bandwidth_Hz = 1000.0;  // corner frequency of the closed current loop (docs/sources.md: our choice)
  double peak_A = 7.0;           // the output stage saturates at +- this
  Vec3d offset_A{};              // error added to each set-point
};

class Amplifiers {
 public:
  // Throws std::invalid_argument for parameters out of range.
  explicit Amplifiers(const AmplifierParameters& parameters);

  // From now on. Disabled: the output stages open and the currents are zero at once (the 0.1 ms in which the
  // windings' inductance lets a current die is not modelled). Throws std::invalid_argument for a set-point
  // that is not finite.
  void command(const Vec3d& setpoint_A, bool enabled);

  // Currents after `delay_s` >= 0 with the present command: target + (now - target) exp(-2 pi bandwidth
  // delay).
  [[nodiscard]] Vec3d current_A(double delay_s) const;

  // Lets `duration_s` pass with the present command.
  void advance(double duration_s);

 private:
  AmplifierParameters parameters_;
  bool enabled_ = false;
  Vec3d target_A_{}, current_A_{};
};

}  // namespace palpate::plant
