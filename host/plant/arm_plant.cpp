#include "host/plant/arm_plant.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "host/plant/check.hpp"

namespace palpate::plant {
namespace {

double square(double x) {
  return x * x;
}

// Torque of one-sided spring-dampers that hold a joint inside [low, high]; they push and never pull.
double stop(double angle_rad, double rad_s, double low_rad, double high_rad, double stiffness,
            double damping) {
  if (angle_rad > high_rad) return std::fmin(0.0, -stiffness * (angle_rad - high_rad) - damping * rad_s);
  if (angle_rad < low_rad) return std::fmax(0.0, stiffness * (low_rad - angle_rad) - damping * rad_s);
  return 0.0;
}

}  // namespace

ArmPlant::ArmPlant(const ArmParameters& parameters) : parameters_(parameters) {
  require_range("arm friction_smoothing_rad_s", parameters.friction_smoothing_rad_s, 1e-4, 1.0);
  require_range("arm stop_margin_rad", parameters.stop_margin_rad, 0.0, 1.0);
  require_range("arm stop_stiffness_N_m_rad", parameters.stop_stiffness_N_m_rad, 0.0, 1e3);
  require_range("arm stop_damping_N_m_s_rad", parameters.stop_damping_N_m_s_rad, 0.0, 1.0);

  const auto real = [](float x) { return static_cast<double>(x); };
  const device::Parameters& device = parameters.device;
  const device::Inertia& in = device.inertia;
  l1_m_ = real(device.l1_m);
  l2_m_ = real(device.l2_m);
  l3_m_ = real(in.l3_m);
  mass_a_kg_ = real(in.mass_a_kg);
  mass_c_kg_ = real(in.mass_c_kg);
  for (std::size_t i = 0; i < 3; ++i) {
    const device::Joint& joint = device.joint[i];
    joint_[i] = {real(joint.coulomb_friction_N_m), real(joint.viscous_friction_N_m_s),
                 real(joint.transmission_ratio) * real(device.torque_constant_N_m_A), real(joint.min_rad),
                 real(joint.max_rad)};
  }
  elbow_min_rad_ = real(device.elbow_min_rad);
  elbow_max_rad_ = real(device.elbow_max_rad);

  base_kg_m2_ = real(in.base_yy_kg_m2);
  upper_yy_kg_m2_ = real(in.be.yy_kg_m2) + real(in.c.yy_kg_m2);
  upper_zz_kg_m2_ = real(in.be.zz_kg_m2) + real(in.c.zz_kg_m2);
  fore_yy_kg_m2_ = real(in.df.yy_kg_m2) + real(in.a.yy_kg_m2);
  fore_zz_kg_m2_ = real(in.df.zz_kg_m2) + real(in.a.zz_kg_m2);
  mass_22_kg_m2_ = real(in.be.xx_kg_m2) + real(in.c.xx_kg_m2) + mass_a_kg_ * square(l1_m_) +
                   mass_c_kg_ * square(0.5 * l1_m_);
  mass_33_kg_m2_ = real(in.df.xx_kg_m2) + real(in.a.xx_kg_m2) + mass_a_kg_ * square(0.5 * l2_m_) +
                   mass_c_kg_ * square(l3_m_);
  coupling_kg_m2_ = 0.5 * l1_m_ * (mass_a_kg_ * l2_m_ + mass_c_kg_ * l3_m_);

  const double g_m_s2 = real(device.gravity_m_s2);
  gravity_2_N_m_ =
      g_m_s2 * (l1_m_ * mass_a_kg_ + real(in.l5_m) * real(in.mass_be_kg) + 0.5 * l1_m_ * mass_c_kg_);
  gravity_3_N_m_ =
      g_m_s2 * (0.5 * l2_m_ * mass_a_kg_ + l3_m_ * mass_c_kg_ - real(in.l6_m) * real(in.mass_df_kg));
}

Vec3d ArmPlant::tip_position_m(const Vec3d& joint_rad) const {
  const double reach = l1_m_ * std::cos(joint_rad.y) + l2_m_ * std::sin(joint_rad.z);
  return {std::sin(joint_rad.x) * reach, l1_m_ - std::cos(joint_rad.x) * reach,
          l2_m_ * (1.0 - std::cos(joint_rad.z)) + l1_m_ * std::sin(joint_rad.y)};
}

Mat3d ArmPlant::jacobian_m(const Vec3d& joint_rad) const {
  const double s1 = std::sin(joint_rad.x), c1 = std::cos(joint_rad.x);
  const double s2 = std::sin(joint_rad.y), c2 = std::cos(joint_rad.y);
  const double s3 = std::sin(joint_rad.z), c3 = std::cos(joint_rad.z);
  const double reach = l1_m_ * c2 + l2_m_ * s3;
  return {{{c1 * reach, -s1 * l1_m_ * s2, s1 * l2_m_ * c3},
           {s1 * reach, c1 * l1_m_ * s2, -c1 * l2_m_ * c3},
           {0.0, l1_m_ * c2, l2_m_ * s3}}};
}

Vec3d ArmPlant::joint_angles_rad(const Vec3d& tip_m, const char* what) const {
  const auto fail = [&](const std::string& reason) -> void {
    std::ostringstream message;
    message << what << " (" << tip_m.x << ", " << tip_m.y << ", " << tip_m.z
            << ") m is outside the arm's workspace: " << reason;
    throw std::invalid_argument(message.str());
  };
  const auto require = [&](const char* name, double value, double low, double high, const char* unit) {
    if (value >= low && value <= high) return;
    std::ostringstream reason;
    reason << name << " " << value << " " << unit << ", allowed " << low << " to " << high << " " << unit;
    fail(reason.str());
  };
  if (!is_finite(tip_m)) fail("not finite");

  // In the vertical plane through base axis and tip: the shoulder at (0, 0), the tip at (reach, height).
  const double reach_m = std::hypot(tip_m.x, l1_m_ - tip_m.y), height_m = tip_m.z - l2_m_;
  const double span_m2 = square(l1_m_) + square(l2_m_), product_m2 = 2.0 * l1_m_ * l2_m_;
  require("distance from the shoulder", std::hypot(reach_m, height_m),
          std::sqrt(span_m2 + product_m2 * std::sin(elbow_min_rad_)),
          std::sqrt(span_m2 + product_m2 * std::sin(elbow_max_rad_)), "m");
  require("distance from the base's axis", reach_m,
          static_cast<double>(parameters_.device.min_base_distance_m), l1_m_ + l2_m_, "m");
  // The elbow t3 - t2 from the law of cosines; on the branch cos(t3 - t2) > 0, the one that the limits allow.
  const double elbow_rad = std::asin((square(reach_m) + square(height_m) - span_m2) / product_m2);
  Vec3d joint_rad;
  joint_rad.x = std::atan2(tip_m.x, l1_m_ - tip_m.y);
  joint_rad.y = std::atan2(height_m, reach_m) +
                std::atan2(l2_m_ * std::cos(elbow_rad), l1_m_ + l2_m_ * std::sin(elbow_rad));
  joint_rad.z = joint_rad.y + elbow_rad;
  constexpr const char* kNames[] = {"base angle t1", "upper-arm angle t2", "forearm angle t3"};
  for (std::size_t i = 0; i < 3; ++i)
    require(kNames[i], joint_rad[i], joint_[i].min_rad, joint_[i].max_rad, "rad");
  return joint_rad;
}

Mat3d ArmPlant::mass_matrix_kg_m2(const Vec3d& joint_rad) const {
  const double s2 = std::sin(joint_rad.y), c2 = std::cos(joint_rad.y);
  const double s3 = std::sin(joint_rad.z), c3 = std::cos(joint_rad.z);
  const double radius_a = l1_m_ * c2 + 0.5 * l2_m_ * s3, radius_c = 0.5 * l1_m_ * c2 + l3_m_ * s3;
  const double m11 = base_kg_m2_ + upper_yy_kg_m2_ * square(c2) + upper_zz_kg_m2_ * square(s2) +
                     fore_yy_kg_m2_ * square(c3) + fore_zz_kg_m2_ * square(s3) +
                     mass_a_kg_ * square(radius_a) + mass_c_kg_ * square(radius_c);
  const double m23 = -coupling_kg_m2_ * (s2 * c3 - c2 * s3);
  return {{{m11, 0.0, 0.0}, {0.0, mass_22_kg_m2_, m23}, {0.0, m23, mass_33_kg_m2_}}};
}

Vec3d ArmPlant::coriolis_torque_N_m(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const {
  const double s2 = std::sin(joint_rad.y), c2 = std::cos(joint_rad.y);
  const double s3 = std::sin(joint_rad.z), c3 = std::cos(joint_rad.z);
  const double radius_a = l1_m_ * c2 + 0.5 * l2_m_ * s3, radius_c = 0.5 * l1_m_ * c2 + l3_m_ * s3;
  // d M11 / d t2 and d t3; d M23 / d t3 = -d M23 / d t2 = coupling * cos(t2 - t3).
  const double m11_2 = 2.0 * s2 * c2 * (upper_zz_kg_m2_ - upper_yy_kg_m2_) -
                       2.0 * l1_m_ * s2 * (mass_a_kg_ * radius_a + 0.5 * mass_c_kg_ * radius_c);
  const double m11_3 = 2.0 * s3 * c3 * (fore_zz_kg_m2_ - fore_yy_kg_m2_) +
                       c3 * (mass_a_kg_ * l2_m_ * radius_a + 2.0 * mass_c_kg_ * l3_m_ * radius_c);
  const double m23_3 = coupling_kg_m2_ * (c2 * c3 + s2 * s3);
  const Vec3d& v = joint_rad_s;
  return {v.x * (m11_2 * v.y + m11_3 * v.z), -0.5 * m11_2 * square(v.x) + m23_3 * square(v.z),
          -0.5 * m11_3 * square(v.x) - m23_3 * square(v.y)};
}

Vec3d ArmPlant::gravity_torque_N_m(const Vec3d& joint_rad) const {
  return {0.0, gravity_2_N_m_ * std::cos(joint_rad.y), gravity_3_N_m_ * std::sin(joint_rad.z)};
}

Vec3d ArmPlant::friction_torque_N_m(const Vec3d& joint_rad_s) const {
  Vec3d torque_N_m;
  for (std::size_t i = 0; i < 3; ++i) {
    const double v = joint_rad_s[i];
    const double direction = v / std::sqrt(square(v) + square(parameters_.friction_smoothing_rad_s));
    torque_N_m[i] = -joint_[i].coulomb_N_m * direction - joint_[i].viscous_N_m_s * v;
  }
  return torque_N_m;
}

Vec3d ArmPlant::stop_torque_N_m(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const {
  const double stiffness = parameters_.stop_stiffness_N_m_rad, margin = parameters_.stop_margin_rad;
  if (stiffness == 0.0) return {};
  const double damping = parameters_.stop_damping_N_m_s_rad;
  Vec3d torque_N_m;
  for (std::size_t i = 0; i < 3; ++i)
    torque_N_m[i] = stop(joint_rad[i], joint_rad_s[i], joint_[i].min_rad - margin, joint_[i].max_rad + margin,
                         stiffness, damping);
  const double elbow_N_m = stop(joint_rad.z - joint_rad.y, joint_rad_s.z - joint_rad_s.y,
                                elbow_min_rad_ - margin, elbow_max_rad_ + margin, stiffness, damping);
  torque_N_m.y -= elbow_N_m;
  torque_N_m.z += elbow_N_m;
  return torque_N_m;
}

Vec3d ArmPlant::acceleration_rad_s2(const Vec3d& joint_rad, const Vec3d& joint_rad_s,
                                    const Vec3d& drive_torque_N_m, const Vec3d& tip_force_N) const {
  const Vec3d torque_N_m = drive_torque_N_m + transpose(jacobian_m(joint_rad)) * tip_force_N +
                           friction_torque_N_m(joint_rad_s) + stop_torque_N_m(joint_rad, joint_rad_s) -
                           coriolis_torque_N_m(joint_rad, joint_rad_s) - gravity_torque_N_m(joint_rad);
  // The base is decoupled; t2 and t3 by Cramer's rule. M is positive definite for every angle.
  const Mat3d mass = mass_matrix_kg_m2(joint_rad);
  const double determinant_23 = mass(1, 1) * mass(2, 2) - square(mass(1, 2));
  return {torque_N_m.x / mass(0, 0), (mass(2, 2) * torque_N_m.y - mass(1, 2) * torque_N_m.z) / determinant_23,
          (mass(1, 1) * torque_N_m.z - mass(1, 2) * torque_N_m.y) / determinant_23};
}

double ArmPlant::energy_J(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const {
  return 0.5 * dot(joint_rad_s, mass_matrix_kg_m2(joint_rad) * joint_rad_s) +
         gravity_2_N_m_ * std::sin(joint_rad.y) - gravity_3_N_m_ * std::cos(joint_rad.z);
}

Vec3d ArmPlant::drive_torque_N_m(const Vec3d& current_A) const {
  return {current_A.x * joint_[0].torque_per_current_N_m_A, current_A.y * joint_[1].torque_per_current_N_m_A,
          current_A.z * joint_[2].torque_per_current_N_m_A};
}

device::EncoderCounts ArmPlant::encoder_counts(const Vec3d& joint_rad) const {
  device::EncoderCounts count{};
  for (std::size_t i = 0; i < 3; ++i)
    count[i] = device::encoder_count(parameters_.device.joint[i], joint_rad[i]);
  return count;
}

}  // namespace palpate::plant
