#include "host/plant/arm_plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "shared/device/arm.hpp"

namespace palpate::plant {
namespace {

constexpr int kSamples = 5'000;

double real(float x) {
  return static_cast<double>(x);
}

class Random {
 public:
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator_);
  }
  Vec3d vector(double size) {
    const double x = between(-size, size), y = between(-size, size), z = between(-size, size);
    return {x, y, z};
  }
  // Inside the workspace.
  Vec3d pose() {
    const device::Parameters& device = device::kPremium15;
    for (;;) {
      Vec3d joint_rad;
      for (std::size_t i = 0; i < 3; ++i)
        joint_rad[i] = between(real(device.joint[i].min_rad), real(device.joint[i].max_rad));
      const Vec3f rounded{static_cast<float>(joint_rad.x), static_cast<float>(joint_rad.y),
                          static_cast<float>(joint_rad.z)};
      if (device::inside_workspace(device, rounded)) return joint_rad;
    }
  }

 private:
  std::mt19937 generator_{11};
};

// Kinetic energy body by body, from the velocities of their centres (by differences along the motion) and
// their rotations: an independent way to the mass matrix.
double kinetic_energy_J(const Vec3d& joint_rad, const Vec3d& joint_rad_s) {
  const device::Inertia& in = device::kPremium15.inertia;
  const double l1 = real(device::kPremium15.l1_m), l2 = real(device::kPremium15.l2_m), l3 = real(in.l3_m);
  const auto place = [](double t1, double radius, double height) {
    return Vec3d{std::sin(t1) * radius, -std::cos(t1) * radius, height};
  };
  const auto centre_a = [&](const Vec3d& t) {
    return place(t.x, l1 * std::cos(t.y) + 0.5 * l2 * std::sin(t.z),
                 l1 * std::sin(t.y) - 0.5 * l2 * std::cos(t.z));
  };
  const auto centre_c = [&](const Vec3d& t) {
    return place(t.x, 0.5 * l1 * std::cos(t.y) + l3 * std::sin(t.z),
                 0.5 * l1 * std::sin(t.y) - l3 * std::cos(t.z));
  };
  constexpr double kStep_s = 1e-5;
  const Vec3d after = joint_rad + joint_rad_s * kStep_s, before = joint_rad - joint_rad_s * kStep_s;
  const Vec3d a_m_s = (centre_a(after) - centre_a(before)) * (0.5 / kStep_s);
  const Vec3d c_m_s = (centre_c(after) - centre_c(before)) * (0.5 / kStep_s);
  // Turning about the vertical, seen in axes that tilt with the link (y across it, z along it at angle 0).
  const auto rotation = [](const device::Moments& moments, double tilt_rad, double tilt_rad_s,
                           double base_rad_s) {
    const double y_rad_s = base_rad_s * std::cos(tilt_rad), z_rad_s = base_rad_s * std::sin(tilt_rad);
    return 0.5 * (real(moments.xx_kg_m2) * tilt_rad_s * tilt_rad_s +
                  real(moments.yy_kg_m2) * y_rad_s * y_rad_s + real(moments.zz_kg_m2) * z_rad_s * z_rad_s);
  };
  return 0.5 * real(in.mass_a_kg) * dot(a_m_s, a_m_s) + 0.5 * real(in.mass_c_kg) * dot(c_m_s, c_m_s) +
         rotation(in.be, joint_rad.y, joint_rad_s.y, joint_rad_s.x) +
         rotation(in.c, joint_rad.y, joint_rad_s.y, joint_rad_s.x) +
         rotation(in.df, joint_rad.z, joint_rad_s.z, joint_rad_s.x) +
         rotation(in.a, joint_rad.z, joint_rad_s.z, joint_rad_s.x) +
         0.5 * real(in.base_yy_kg_m2) * joint_rad_s.x * joint_rad_s.x;
}

TEST(ArmPlant, MassMatrixGivesTheBodiesKineticEnergy) {
  constexpr double kRelativeError =
      1e-7;  // the differences' truncation, (5 rad/s * 1e-5 s)^2 / 6 * a few, and rounding
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d joint_rad = random.pose(), joint_rad_s = random.vector(5.0);
    const double expected_J = kinetic_energy_J(joint_rad, joint_rad_s);
    const double energy_J = 0.5 * dot(joint_rad_s, arm.mass_matrix_kg_m2(joint_rad) * joint_rad_s);
    ASSERT_NEAR(energy_J, expected_J, kRelativeError * expected_J);
  }
}

TEST(ArmPlant, MassMatrixIsSymmetricPositiveDefinite) {
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Mat3d mass = arm.mass_matrix_kg_m2(random.vector(4.0));  // anywhere, outside the workspace too
    EXPECT_EQ(mass(0, 1), mass(1, 0));
    EXPECT_EQ(mass(0, 2), mass(2, 0));
    EXPECT_EQ(mass(1, 2), mass(2, 1));
    // Leading minors (Sylvester).
    ASSERT_GT(mass(0, 0), 0.0);
    ASSERT_GT(mass(0, 0) * mass(1, 1) - mass(0, 1) * mass(1, 0), 0.0);
    ASSERT_GT(determinant(mass), 0.0);
  }
}

TEST(ArmPlant, CoriolisTorqueFollowsFromTheMassMatrix) {
  // c_i = sum_jk (dM_ij / dt_k - 1/2 dM_jk / dt_i) v_j v_k, with differences of M.
  constexpr double kStep_rad = 1e-5;
  constexpr double kError_N_m =
      1e-9;  // M of 3e-3 kg m^2 * (step^2 / 6 + 1e-16 / step) * 9 terms * 25 rad^2/s^2
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int sample = 0; sample < kSamples; ++sample) {
    const Vec3d joint_rad = random.pose(), v = random.vector(5.0);
    std::array<Mat3d, 3> slope{};
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3d above = joint_rad, below = joint_rad;
      above[k] += kStep_rad;
      below[k] -= kStep_rad;
      const Mat3d high = arm.mass_matrix_kg_m2(above), low = arm.mass_matrix_kg_m2(below);
      for (std::size_t r = 0; r < 3; ++r) slope[k].row[r] = (high.row[r] - low.row[r]) * (0.5 / kStep_rad);
    }
    const Vec3d torque_N_m = arm.coriolis_torque_N_m(joint_rad, v);
    for (std::size_t i = 0; i < 3; ++i) {
      double expected_N_m = 0.0;
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k)
          expected_N_m += (slope[k](i, j) - 0.5 * slope[i](j, k)) * v[j] * v[k];
      ASSERT_NEAR(torque_N_m[i], expected_N_m, kError_N_m);
    }
  }
}

TEST(ArmPlant, GravityIsWhatTheFirmwareCompensates) {
  // Single-precision rounding of torques up to 0.08 N m: a few times 0.08 * 2^-24, and sin_cos's 1.2e-7.
  constexpr double kFloatError_N_m = 3e-8;
  const ArmPlant arm(ArmParameters{});
  Random random;
  double worst_N_m = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d pose = random.pose();
    const Vec3f rounded{static_cast<float>(pose.x), static_cast<float>(pose.y), static_cast<float>(pose.z)};
    const Vec3f firmware_N_m = device::gravity_torque(device::kPremium15, rounded);
    const Vec3d plant_N_m = arm.gravity_torque_N_m({real(rounded.x), real(rounded.y), real(rounded.z)});
    for (std::size_t j = 0; j < 3; ++j)
      worst_N_m = std::max(worst_N_m, std::abs(real(firmware_N_m[j]) - plant_N_m[j]));
  }
  EXPECT_LT(worst_N_m, kFloatError_N_m);
}

TEST(ArmPlant, KinematicsAreThoseOfTheFirmware) {
  constexpr double kFloatError_m = 2.5e-7;  // as in shared/device/arm_test.cpp
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d pose = random.pose();
    const Vec3f rounded{static_cast<float>(pose.x), static_cast<float>(pose.y), static_cast<float>(pose.z)};
    const Vec3d exact{real(rounded.x), real(rounded.y), real(rounded.z)};
    const device::Pose firmware = device::evaluate(device::kPremium15, rounded);
    const Vec3d tip_m = arm.tip_position_m(exact);
    const Mat3d jacobian_m = arm.jacobian_m(exact);
    for (std::size_t r = 0; r < 3; ++r) {
      ASSERT_NEAR(real(firmware.tip_m[r]), tip_m[r], kFloatError_m);
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_NEAR(real(firmware.jacobian_m(r, c)), jacobian_m(r, c), kFloatError_m);
    }
  }
}

TEST(ArmPlant, InverseKinematicsInvertsTheKinematics) {
  constexpr double kError_rad = 1e-12;  // conditioning: 1 / (l2 * smallest elbow cosine 0.4), times rounding
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d joint_rad = random.pose();
    ASSERT_LT(norm(arm.joint_angles_rad(arm.tip_position_m(joint_rad), "tip") - joint_rad), kError_rad);
  }
}

TEST(ArmPlant, PositionsOutOfReachAreRefusedByNameValueAndRange) {
  const ArmPlant arm(ArmParameters{});
  const auto message_of = [&arm](const Vec3d& tip_m) -> std::string {
    try {
      (void)arm.joint_angles_rad(tip_m, "start tip");
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message_of({0.0, 0.0, 0.0}), "accepted");
  EXPECT_EQ(message_of({0.0, -0.3, 0.0}),
            "start tip (0, -0.3, 0) m is outside the arm's workspace: distance from the shoulder 0.542333 m, "
            "allowed 0.094934 to 0.367434 m");
  EXPECT_NE(message_of({0.0, 0.2, 0.05}).find("distance from the base's axis 0.015 m, allowed 0.05"),
            std::string::npos);
  EXPECT_NE(message_of({0.2, 0.2, 0.1}).find("base angle t1 1.49594 rad, allowed -1.2 to 1.2 rad"),
            std::string::npos);
  EXPECT_NE(message_of({0.0, std::nan(""), 0.1}).find("not finite"), std::string::npos);
}

// Mass that a force on the tip in direction u feels at rest: 1 / (u . J M^-1 J^T u).
double apparent_mass_kg(const ArmPlant& arm, const Vec3d& joint_rad, const Vec3d& u) {
  const Vec3d torque_N_m = transpose(arm.jacobian_m(joint_rad)) * u;
  Vec3d acceleration_rad_s2;
  EXPECT_TRUE(solve(arm.mass_matrix_kg_m2(joint_rad), torque_N_m, acceleration_rad_s2));
  return 1.0 / dot(torque_N_m, acceleration_rad_s2);
}

TEST(ArmPlant, ApparentTipMassIsThatOfTheDevice) {
  // Data sheet: below 75 g. The Lagrangian gives 77, 32 and 52 g along x, y, z in the reference pose.
  constexpr double kLargest_kg = 0.2;
  const ArmPlant arm(ArmParameters{});
  const std::array<Vec3d, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const std::array<double, 3> expected_kg{0.077, 0.032, 0.052};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(apparent_mass_kg(arm, {}, axes[i]), expected_kg[i], 1e-3);
  double smallest_kg = 1.0, largest_kg = 0.0;
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d joint_rad = arm.joint_angles_rad(random.vector(0.05), "tip");
    for (const Vec3d& axis : axes) {
      const double mass_kg = apparent_mass_kg(arm, joint_rad, axis);
      smallest_kg = std::min(smallest_kg, mass_kg);
      largest_kg = std::max(largest_kg, mass_kg);
    }
  }
  RecordProperty("smallest_g", std::to_string(smallest_kg * 1e3));
  RecordProperty("largest_g", std::to_string(largest_kg * 1e3));
  EXPECT_GT(smallest_kg, 0.01);
  EXPECT_LT(largest_kg, kLargest_kg);
}

TEST(ArmPlant, FrictionAndStopsOnlyTakeEnergy) {
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d joint_rad_s = random.vector(3.0);
    ASSERT_LE(dot(arm.friction_torque_N_m(joint_rad_s), joint_rad_s), 0.0);
    // A stop pushes more against a joint that comes in than one that goes out.
    const Vec3d joint_rad = random.vector(2.5);
    const Vec3d spring_N_m = arm.stop_torque_N_m(joint_rad, {});
    ASSERT_LE(dot(arm.stop_torque_N_m(joint_rad, joint_rad_s) - spring_N_m, joint_rad_s), 1e-12);
  }
}

TEST(ArmPlant, BackdriveFrictionIsThatOfTheDataSheet) {
  // 0.04 N at the tip in the reference pose, for each joint at a speed where the smoothing no longer shows
  // (0.5 rad/s).
  const ArmPlant arm(ArmParameters{});
  const Vec3d torque_N_m = arm.friction_torque_N_m({0.5, 0.5, 0.5});
  EXPECT_NEAR(-torque_N_m.x / real(device::kPremium15.l1_m), 0.04, 0.002);
  EXPECT_NEAR(-torque_N_m.y / real(device::kPremium15.l1_m), 0.04, 0.002);
  EXPECT_NEAR(-torque_N_m.z / real(device::kPremium15.l2_m), 0.04, 0.002);
}

TEST(ArmPlant, StopsBeginBeyondTheLimits) {
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i)
    ASSERT_EQ(arm.stop_torque_N_m(random.pose(), random.vector(3.0)), Vec3d{});
  EXPECT_LT(arm.stop_torque_N_m({1.3, 0.0, 0.0}, {}).x, 0.0);
  EXPECT_GT(arm.stop_torque_N_m({-1.3, 0.0, 0.0}, {}).x, 0.0);
  const Vec3d elbow_N_m = arm.stop_torque_N_m({0.0, 0.0, 1.2}, {});  // pushes both links apart
  EXPECT_GT(elbow_N_m.y, 0.0);
  EXPECT_EQ(elbow_N_m.y, -elbow_N_m.z);
}

TEST(ArmPlant, EncodersAreReadBackByTheFirmware) {
  const ArmPlant arm(ArmParameters{});
  Random random;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3d pose = random.pose();
    const Vec3f read_rad = device::joint_angles(device::kPremium15, arm.encoder_counts(pose), {});
    for (std::size_t j = 0; j < 3; ++j) {
      constexpr double kHalfCount = 0.501;  // and the float's rounding of up to 14,000 counts
      ASSERT_LE(std::abs(real(read_rad[j]) - pose[j]) * real(device::kPremium15.joint[j].counts_per_rad),
                kHalfCount);
    }
  }
}

TEST(ArmPlant, RefusesParametersOutOfRange) {
  EXPECT_THROW(ArmPlant(ArmParameters{.friction_smoothing_rad_s = 0.0}), std::invalid_argument);
  EXPECT_THROW(ArmPlant(ArmParameters{.stop_stiffness_N_m_rad = -1.0}), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::plant
