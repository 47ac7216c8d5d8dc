// Kinematics and statics of the arm: where the tip is, and which joint torques make it push.
//
// Joint angles t1 (base, about the vertical), t2 (upper arm from the horizontal), t3 (forearm from the
// vertical) as in Cavusoglu, Feygin, Tendick, Presence 11(6), 2002. Device frame: origin at the tip's
// position at t = 0, x to the user's right, y away from the user, z up; so (x, y, z) = (x, -z, y) of the
// paper. Nothing is divided by: all results are finite for every angle that is accepted, singular poses
// included.
#pragma once

#include <cstdint>

#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::device {

// What is wrong with a pose; bits that can come together.
enum PoseFault : std::uint8_t {
  kInvalidAngle = 1u << 0,   // NaN, infinite or beyond the range of sin_cos: nothing else is known
  kJointLimit = 1u << 1,     // a joint, or the elbow t3 - t2, beyond its limits
  kElbowSingular = 1u << 2,  // cos(t2 - t3) below its margin: stretched, folded or turned over
  kBaseSingular = 1u << 3,   // tip too close to the base's axis, or behind it
};

// All that a servo tick needs to know of a pose, from one evaluation of sines and cosines.
struct Pose {
  std::uint8_t faults = kInvalidAngle;  // PoseFault; 0: inside the workspace
  Vec3f tip_m{};                        // device frame
  Mat3f jacobian_m{};                   // d tip / d joint angle, m/rad
  Vec3f gravity_torque_N_m{};           // that the motors must add to hold the arm against gravity
};

// Any context. With kInvalidAngle the tip is the origin, and Jacobian and gravity torque are zero, so that
// every torque made from them is zero too; with any other fault all values are true ones.
[[nodiscard]] Pose evaluate(const Parameters& device, const Vec3f& joint_rad);

// Joint torques that make the tip exert tip_force_N on what it touches or who holds it, at rest and without
// gravity: J^T f (virtual work).
inline Vec3f joint_torque(const Pose& pose, const Vec3f& tip_force_N) {
  return transpose(pose.jacobian_m) * tip_force_N;
}

// The same, one quantity at a time, for callers that need only that.
[[nodiscard]] inline Vec3f forward_kinematics(const Parameters& device, const Vec3f& joint_rad) {
  return evaluate(device, joint_rad).tip_m;
}
[[nodiscard]] inline Mat3f jacobian(const Parameters& device, const Vec3f& joint_rad) {
  return evaluate(device, joint_rad).jacobian_m;
}
[[nodiscard]] inline Vec3f gravity_torque(const Parameters& device, const Vec3f& joint_rad) {
  return evaluate(device, joint_rad).gravity_torque_N_m;
}
[[nodiscard]] inline bool inside_workspace(const Parameters& device, const Vec3f& joint_rad) {
  return evaluate(device, joint_rad).faults == 0;
}

}  // namespace palpate::device
