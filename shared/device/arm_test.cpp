#include "shared/device/arm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace palpate::device {
namespace {

// The paper's formulas in double precision, in the device frame: the reference for the single-precision code.
Vec3d reference_tip_m(const Parameters& device, const Vec3d& joint_rad) {
  const double l1 = static_cast<double>(device.l1_m), l2 = static_cast<double>(device.l2_m);
  const double reach = l1 * std::cos(joint_rad.y) + l2 * std::sin(joint_rad.z);
  const double paper_x = std::sin(joint_rad.x) * reach;
  const double paper_y = l2 - l2 * std::cos(joint_rad.z) + l1 * std::sin(joint_rad.y);
  const double paper_z = -l1 + std::cos(joint_rad.x) * reach;
  return {paper_x, -paper_z, paper_y};
}

Vec3d to_double(const Vec3f& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

// Poses all over the ranges of the joints, inside the workspace or not.
class Poses {
 public:
  Vec3f next(const Parameters& device) {
    Vec3f joint_rad;
    for (std::size_t i = 0; i < 3; ++i) {
      std::uniform_real_distribution<float> angle(device.joint[i].min_rad, device.joint[i].max_rad);
      joint_rad[i] = angle(random_);
    }
    return joint_rad;
  }
  Vec3f vector(float size) {
    std::uniform_real_distribution<float> uniform(-size, size);
    const float x = uniform(random_), y = uniform(random_), z = uniform(random_);
    return {x, y, z};
  }

 private:
  std::mt19937 random_{7};
};

constexpr int kSamples = 20'000;

// About four roundings of numbers below 0.4 m: 0.4 * 2^-24 = 2.4e-8 m each, and sin_cos's 1.2e-7 times 0.4 m
// thrice.
constexpr double kTipError_m = 2.5e-7;

TEST(Arm, TipAgreesWithTheFormulasInDoublePrecision) {
  Poses poses;
  double worst_m = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f joint_rad = poses.next(kPremium15);
    const Vec3d expected_m = reference_tip_m(kPremium15, to_double(joint_rad));
    worst_m = std::max(worst_m, norm(to_double(forward_kinematics(kPremium15, joint_rad)) - expected_m));
  }
  RecordProperty("worst_m", std::to_string(worst_m * 1e9) + "e-9");
  EXPECT_LT(worst_m, kTipError_m);
}

TEST(Arm, TipIsAtTheOriginInTheReferencePose) {
  EXPECT_EQ(forward_kinematics(kPremium15, {}), Vec3f{});
  EXPECT_TRUE(inside_workspace(kPremium15, {}));
}

TEST(Arm, PositiveDirectionsOfTheDeviceFrame) {
  constexpr float kSmall_rad = 0.1f;
  EXPECT_GT(forward_kinematics(kPremium15, {kSmall_rad, 0, 0}).x, 0.0f);  // base turns the tip to the right
  EXPECT_GT(forward_kinematics(kPremium15, {0, kSmall_rad, 0}).z, 0.0f);  // upper arm lifts it
  EXPECT_LT(forward_kinematics(kPremium15, {0, 0, kSmall_rad}).y, 0.0f);  // forearm pulls it towards the user
}

TEST(Arm, JacobianIsTheDerivativeOfTheTip) {
  // Central differences of the double-precision tip: truncation 0.4 * step^2 / 6, rounding 1e-16 / step.
  constexpr double kStep_rad = 1e-5;
  constexpr double kError_m = 2.5e-7;  // of the float entries: as kTipError_m
  Poses poses;
  double worst_m = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f joint_rad = poses.next(kPremium15);
    const Mat3f jacobian_m = jacobian(kPremium15, joint_rad);
    for (std::size_t column = 0; column < 3; ++column) {
      Vec3d above = to_double(joint_rad), below = above;
      above[column] += kStep_rad;
      below[column] -= kStep_rad;
      const Vec3d difference =
          (reference_tip_m(kPremium15, above) - reference_tip_m(kPremium15, below)) * (0.5 / kStep_rad);
      for (std::size_t row = 0; row < 3; ++row)
        worst_m = std::max(worst_m, std::abs(static_cast<double>(jacobian_m(row, column)) - difference[row]));
    }
  }
  RecordProperty("worst_m", std::to_string(worst_m * 1e9) + "e-9");
  EXPECT_LT(worst_m, kError_m);
}

TEST(Arm, TorqueDoesTheWorkOfTheForce) {
  constexpr float kRelativeError = 2e-6f;  // some ten roundings of 2^-24 each
  Poses poses;
  for (int i = 0; i < kSamples; ++i) {
    const Pose pose = evaluate(kPremium15, poses.next(kPremium15));
    const Vec3f force_N = poses.vector(8.5f), joint_rad_s = poses.vector(5.0f);
    const float tip_power_W = dot(force_N, pose.jacobian_m * joint_rad_s);
    const float joint_power_W = dot(joint_torque(pose, force_N), joint_rad_s);
    const float scale_W = norm(force_N) * norm(joint_rad_s) * kPremium15.l1_m;
    ASSERT_NEAR(tip_power_W, joint_power_W, kRelativeError * scale_W);
  }
}

TEST(Arm, GravityTorqueIsTheDerivativeOfThePotentialEnergy) {
  constexpr double kStep_rad = 1e-5;
  constexpr double kError_N_m = 2e-8;  // torques below 0.1 N m, a few roundings
  const Inertia& in = kPremium15.inertia;
  // Potential energy from the heights of the centres of mass: a at the middle of the forearm, c at the middle
  // of a rod as long as the upper arm, be and df at their distances from the shoulder.
  const auto potential_J = [&in](double t2, double t3) {
    const double l1 = static_cast<double>(kPremium15.l1_m), l2 = static_cast<double>(kPremium15.l2_m);
    const double height_a = l1 * std::sin(t2) - 0.5 * l2 * std::cos(t3);
    const double height_c = 0.5 * l1 * std::sin(t2) - static_cast<double>(in.l3_m) * std::cos(t3);
    const double height_be = static_cast<double>(in.l5_m) * std::sin(t2);
    const double height_df = static_cast<double>(in.l6_m) * std::cos(t3);
    return static_cast<double>(kPremium15.gravity_m_s2) *
           (static_cast<double>(in.mass_a_kg) * height_a + static_cast<double>(in.mass_c_kg) * height_c +
            static_cast<double>(in.mass_be_kg) * height_be + static_cast<double>(in.mass_df_kg) * height_df);
  };
  Poses poses;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f joint_rad = poses.next(kPremium15);
    const Vec3d torque_N_m = to_double(gravity_torque(kPremium15, joint_rad));
    const double t2 = static_cast<double>(joint_rad.y), t3 = static_cast<double>(joint_rad.z);
    ASSERT_EQ(torque_N_m.x, 0.0);
    ASSERT_NEAR(torque_N_m.y,
                (potential_J(t2 + kStep_rad, t3) - potential_J(t2 - kStep_rad, t3)) / (2.0 * kStep_rad),
                kError_N_m);
    ASSERT_NEAR(torque_N_m.z,
                (potential_J(t2, t3 + kStep_rad) - potential_J(t2, t3 - kStep_rad)) / (2.0 * kStep_rad),
                kError_N_m);
  }
}

TEST(Arm, SingularPosesAreReportedAndFinite) {
  constexpr float kRightAngle = 1.57079633f;
  struct Case {
    Vec3f joint_rad;
    std::uint8_t expected;
  };
  const Case cases[] = {
      {{0, 0, kRightAngle}, kElbowSingular},         // stretched
      {{0, kRightAngle, 0}, kElbowSingular},         // folded
      {{0, 0, 2.0f * kRightAngle}, kElbowSingular},  // elbow turned over
      {{0, 1.4f, -0.3f}, kBaseSingular},             // tip behind the base's axis: reach -0.014 m
      {{0, kRightAngle, 0.1f}, kBaseSingular},       // 0.017 m from it
  };
  for (const Case& c : cases) {
    const Pose pose = evaluate(kPremium15, c.joint_rad);
    EXPECT_NE(pose.faults & c.expected, 0) << c.joint_rad.y << ", " << c.joint_rad.z;
    const Vec3f torque_N_m = joint_torque(pose, {8.5f, -8.5f, 8.5f});
    EXPECT_TRUE(is_finite(pose.tip_m) && is_finite(torque_N_m) && is_finite(pose.gravity_torque_N_m));
    // |J^T f| <= |f| times the arm's longest lever.
    EXPECT_LE(norm(torque_N_m), 8.5f * 1.7321f * 2.0f * (kPremium15.l1_m + kPremium15.l2_m));
  }
}

TEST(Arm, JacobianIsRegularInsideTheWorkspace) {
  // |det J| = l1 l2 |reach| |cos(t2 - t3)|, at least the product of the two margins.
  const float smallest = kPremium15.l1_m * kPremium15.l2_m * kPremium15.min_base_distance_m *
                         kPremium15.min_elbow_cosine * 0.999f;
  Poses poses;
  int inside = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Pose pose = evaluate(kPremium15, poses.next(kPremium15));
    if (pose.faults != 0) continue;
    ++inside;
    ASSERT_GE(std::fabs(determinant(pose.jacobian_m)), smallest);
  }
  EXPECT_GT(inside, kSamples / 4);
}

TEST(Arm, EveryLimitIsReported) {
  const auto faults = [](float t1, float t2, float t3) { return evaluate(kPremium15, {t1, t2, t3}).faults; };
  const auto& joint = kPremium15.joint;
  constexpr float kBeyond_rad = 1e-3f;
  EXPECT_EQ(faults(joint[0].max_rad, 0, 0), 0);
  EXPECT_EQ(faults(joint[0].max_rad + kBeyond_rad, 0, 0), kJointLimit);
  EXPECT_EQ(faults(joint[0].min_rad - kBeyond_rad, 0, 0), kJointLimit);
  EXPECT_EQ(faults(0, joint[1].min_rad - kBeyond_rad, -0.3f), kJointLimit);
  EXPECT_NE(faults(0, joint[1].max_rad + kBeyond_rad, 1.2f) & kJointLimit, 0);
  EXPECT_EQ(faults(0, 0.2f, joint[2].min_rad - kBeyond_rad), kJointLimit);
  EXPECT_EQ(faults(0, 1.2f, joint[2].max_rad + kBeyond_rad), kJointLimit);
  EXPECT_EQ(faults(0, 0, kPremium15.elbow_max_rad + kBeyond_rad), kJointLimit);
  EXPECT_EQ(faults(0, 0.9f, 0.9f + kPremium15.elbow_min_rad - kBeyond_rad), kJointLimit);
  EXPECT_EQ(faults(0, 0, kPremium15.elbow_max_rad - kBeyond_rad), 0);
}

TEST(Arm, AnglesThatAreNoAnglesGiveZeroTorque) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const float bad_rad : {kNan, kInfinity, -kInfinity, 101.0f, -3e38f}) {
    for (std::size_t i = 0; i < 3; ++i) {
      Vec3f joint_rad{0.1f, 0.2f, 0.3f};
      joint_rad[i] = bad_rad;
      const Pose pose = evaluate(kPremium15, joint_rad);
      EXPECT_EQ(pose.faults, kInvalidAngle);
      EXPECT_FALSE(inside_workspace(kPremium15, joint_rad));
      EXPECT_EQ(joint_torque(pose, {1, 2, 3}), Vec3f{});
      EXPECT_EQ(pose.gravity_torque_N_m, Vec3f{});
      EXPECT_EQ(pose.tip_m, Vec3f{});
    }
  }
}

}  // namespace
}  // namespace palpate::device
