// The arm as a mechanism: rigid-body dynamics, friction and end stops, in double precision.
//
//   M(t) t'' + c(t, t') + g(t) = drive + friction + stops + J^T f
//
// with the Lagrangian of Cavusoglu, Feygin, Tendick, Presence 11(6), 2002, and the numbers of shared/device,
// which docs/sources.md traces. Our deviation: c is derived here from M by Christoffel symbols; in the
// transcription of the paper that we could check, the term of t2'^2 in the third equation has the other sign,
// which does not conserve energy. Joint angles in rad, tip positions in the device frame
// (docs/units_and_frames.md). Stateless; the state is Plant's.
#pragma once

#include "shared/device/encoders.hpp"
#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::plant {

struct ArmParameters {
  device::Parameters device = device::kPremium15;
  // Coulomb friction is -T v / sqrt(v^2 + v0^2) with this v0: a smoothed sign function, for an integrator
  // cannot follow a jump. Below v0 the joint creeps instead of sticking; 0.005 rad/s is 1 mm/s at the tip.
  double friction_smoothing_rad_s = 0.005;
  // End stops: springs with dampers that begin stop_margin_rad beyond the device's limits. Stiffness 0: no
  // stops.
  double stop_margin_rad = 0.03;
  double stop_stiffness_N_m_rad = 50.0;
  double stop_damping_N_m_s_rad = 0.1;
};

class ArmPlant {
 public:
  // Throws std::invalid_argument for parameters out of range.
  explicit ArmPlant(const ArmParameters& parameters);

  [[nodiscard]] const ArmParameters& parameters() const { return parameters_; }

  [[nodiscard]] Vec3d tip_position_m(const Vec3d& joint_rad) const;
  [[nodiscard]] Mat3d jacobian_m(const Vec3d& joint_rad) const;
  // Inverse kinematics in closed form. Throws std::invalid_argument, naming `what`, the position and the
  // range that it leaves, when the tip cannot be there within the device's limits.
  [[nodiscard]] Vec3d joint_angles_rad(const Vec3d& tip_m, const char* what) const;

  [[nodiscard]] Mat3d mass_matrix_kg_m2(const Vec3d& joint_rad) const;
  [[nodiscard]] Vec3d coriolis_torque_N_m(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const;
  [[nodiscard]] Vec3d gravity_torque_N_m(const Vec3d& joint_rad) const;
  // What friction and stops do to the joints.
  [[nodiscard]] Vec3d friction_torque_N_m(const Vec3d& joint_rad_s) const;
  [[nodiscard]] Vec3d stop_torque_N_m(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const;
  // tip_force_N: of the surroundings on the tip.
  [[nodiscard]] Vec3d acceleration_rad_s2(const Vec3d& joint_rad, const Vec3d& joint_rad_s,
                                          const Vec3d& drive_torque_N_m, const Vec3d& tip_force_N) const;
  // Kinetic and gravitational energy; the stops' is not in it.
  [[nodiscard]] double energy_J(const Vec3d& joint_rad, const Vec3d& joint_rad_s) const;

  [[nodiscard]] Vec3d drive_torque_N_m(const Vec3d& current_A) const;
  [[nodiscard]] device::EncoderCounts encoder_counts(const Vec3d& joint_rad) const;

 private:
  struct JointConstants {
    double coulomb_N_m, viscous_N_m_s, torque_per_current_N_m_A, min_rad, max_rad;
  };

  ArmParameters parameters_;
  double l1_m_, l2_m_, l3_m_, mass_a_kg_, mass_c_kg_;
  JointConstants joint_[3];
  double elbow_min_rad_, elbow_max_rad_;
  // Moments of inertia about the base's axis: of upper-arm bodies (be, c) and forearm bodies (df, a) along
  // and across.
  double base_kg_m2_, upper_yy_kg_m2_, upper_zz_kg_m2_, fore_yy_kg_m2_, fore_zz_kg_m2_;
  double mass_22_kg_m2_, mass_33_kg_m2_, coupling_kg_m2_;
  double gravity_2_N_m_, gravity_3_N_m_;  // potential energy = gravity_2 sin t2 - gravity_3 cos t3
};

}  // namespace palpate::plant
