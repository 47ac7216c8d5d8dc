#include "shared/device/arm.hpp"

#include "shared/math/trig.hpp"

namespace palpate::device {
namespace {

// Written so that NaN is outside.
bool within(float value, float low, float high) {
  return value >= low && value <= high;
}

std::uint8_t limit_faults(const Parameters& device, const Vec3f& joint_rad, float elbow_cosine,
                          float base_distance_m) {
  bool joints_within = within(joint_rad.z - joint_rad.y, device.elbow_min_rad, device.elbow_max_rad);
  for (std::size_t i = 0; i < 3; ++i)
    joints_within = joints_within && within(joint_rad[i], device.joint[i].min_rad, device.joint[i].max_rad);
  unsigned faults = 0;
  if (!joints_within) faults |= kJointLimit;
  if (!(elbow_cosine >= device.min_elbow_cosine)) faults |= kElbowSingular;
  if (!(base_distance_m >= device.min_base_distance_m)) faults |= kBaseSingular;
  return static_cast<std::uint8_t>(faults);
}

}  // namespace

Pose evaluate(const Parameters& device, const Vec3f& joint_rad) {
  for (std::size_t i = 0; i < 3; ++i)
    if (!within(joint_rad[i], -kSinCosRange_rad, kSinCosRange_rad)) return {};
  const SinCos t1 = sin_cos(joint_rad.x), t2 = sin_cos(joint_rad.y), t3 = sin_cos(joint_rad.z);
  const float l1 = device.l1_m, l2 = device.l2_m;
  const float reach = l1 * t2.cosine + l2 * t3.sine;  // of the tip from the base's axis, signed

  Pose pose;
  pose.tip_m = {t1.sine * reach, l1 - t1.cosine * reach, (l2 - l2 * t3.cosine) + l1 * t2.sine};
  const float radial_2 = -l1 * t2.sine, radial_3 = l2 * t3.cosine;  // d reach / d t2, d t3
  pose.jacobian_m = {{{t1.cosine * reach, t1.sine * radial_2, t1.sine * radial_3},
                      {t1.sine * reach, -t1.cosine * radial_2, -t1.cosine * radial_3},
                      {0.0f, l1 * t2.cosine, l2 * t3.sine}}};

  // N(t) of the paper: the derivative of the potential energy; the base turns about the vertical and has
  // none.
  const Inertia& in = device.inertia;
  const float moment_2 = l1 * in.mass_a_kg + in.l5_m * in.mass_be_kg + 0.5f * l1 * in.mass_c_kg;
  const float moment_3 = 0.5f * l2 * in.mass_a_kg + in.l3_m * in.mass_c_kg - in.l6_m * in.mass_df_kg;
  pose.gravity_torque_N_m = {0.0f, device.gravity_m_s2 * moment_2 * t2.cosine,
                             device.gravity_m_s2 * moment_3 * t3.sine};

  const float elbow_cosine = t2.cosine * t3.cosine + t2.sine * t3.sine;
  pose.faults = limit_faults(device, joint_rad, elbow_cosine, reach);
  return pose;
}

}  // namespace palpate::device
