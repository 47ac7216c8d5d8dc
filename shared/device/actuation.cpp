#include "shared/device/actuation.hpp"

#include <cmath>
#include <cstddef>

namespace palpate::device {

CurrentSetpoints motor_currents(const Parameters& device, const Vec3f& joint_torque_N_m) {
  Vec3f current_A;
  float largest_A = 0.0f;
  for (std::size_t i = 0; i < 3; ++i) {
    current_A[i] = joint_torque_N_m[i] / (device.joint[i].transmission_ratio * device.torque_constant_N_m_A);
    const float magnitude_A = std::fabs(current_A[i]);
    if (magnitude_A > largest_A) largest_A = magnitude_A;
  }
  if (!is_finite(current_A)) return {};
  if (largest_A <= device.peak_current_A) return {current_A, 1.0f};
  const float scale = device.peak_current_A / largest_A;
  for (std::size_t i = 0; i < 3; ++i) {
    current_A[i] *= scale;
    // The product is rounded: it could exceed the peak by its last bit.
    if (current_A[i] > device.peak_current_A) current_A[i] = device.peak_current_A;
    if (current_A[i] < -device.peak_current_A) current_A[i] = -device.peak_current_A;
  }
  return {current_A, scale};
}

}  // namespace palpate::device
