// Joint torques to motor currents.
#pragma once

#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::device {

struct CurrentSetpoints {
  Vec3f current_A{};
  // 1: as asked for; below 1: all three were scaled by this, so that the largest is at the peak current;
  // 0: the torques were not finite and the currents are zero.
  float scale = 0.0f;
};

// Any context. The motor currents for the joint torques, torque / (ratio x torque constant). Too large ones
// are scaled together rather than cut one by one: the tip's force then keeps its direction.
[[nodiscard]] CurrentSetpoints motor_currents(const Parameters& device, const Vec3f& joint_torque_N_m);

}  // namespace palpate::device
