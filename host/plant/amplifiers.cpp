#include "host/plant/amplifiers.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "host/plant/check.hpp"

namespace palpate::plant {

Amplifiers::Amplifiers(const AmplifierParameters& parameters) : parameters_(parameters) {
  require_range("amplifier bandwidth_Hz", parameters.bandwidth_Hz, 1.0, 1e6);
  require_range("amplifier peak_A", parameters.peak_A, 0.0, 100.0);
  for (std::size_t i = 0; i < 3; ++i)
    require_range("amplifier offset_A", parameters.offset_A[i], -parameters.peak_A, parameters.peak_A);
}

void Amplifiers::command(const Vec3d& setpoint_A, bool enabled) {
  if (!is_finite(setpoint_A)) {
    std::ostringstream message;
    message << "current set-point (" << setpoint_A.x << ", " << setpoint_A.y << ", " << setpoint_A.z
            << ") A is not finite, allowed are finite currents";
    throw std::invalid_argument(message.str());
  }
  enabled_ = enabled;
  if (!enabled) {
    target_A_ = current_A_ = {};
    return;
  }
  for (std::size_t i = 0; i < 3; ++i)
    target_A_[i] =
        std::clamp(setpoint_A[i] + parameters_.offset_A[i], -parameters_.peak_A, parameters_.peak_A);
}

Vec3d Amplifiers::current_A(double delay_s) const {
  if (!enabled_) return {};
  const double remaining = std::exp(-2.0 * std::numbers::pi * parameters_.bandwidth_Hz * delay_s);
  return target_A_ + (current_A_ - target_A_) * remaining;
}

void Amplifiers::advance(double duration_s) {
  current_A_ = current_A(duration_s);
}

}  // namespace palpate::plant
