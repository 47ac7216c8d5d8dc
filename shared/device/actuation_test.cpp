#include "shared/device/actuation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "shared/device/arm.hpp"

namespace palpate::device {
namespace {

float largest_A(const Vec3f& current_A) {
  return std::max({std::fabs(current_A.x), std::fabs(current_A.y), std::fabs(current_A.z)});
}

TEST(Actuation, CurrentIsTorqueThroughTheTransmission) {
  constexpr float kRelativeError = 3e-7f;  // three roundings
  const Vec3f torque_N_m{0.3f, -0.2f, 0.1f};
  const CurrentSetpoints setpoints = motor_currents(kPremium15, torque_N_m);
  EXPECT_EQ(setpoints.scale, 1.0f);
  for (std::size_t i = 0; i < 3; ++i) {
    const float motor_torque_N_m = setpoints.current_A[i] * kPremium15.torque_constant_N_m_A;
    EXPECT_NEAR(motor_torque_N_m * kPremium15.joint[i].transmission_ratio, torque_N_m[i], kRelativeError);
  }
}

TEST(Actuation, TooLargeTorquesKeepTheirDirection) {
  const Vec3f torque_N_m{4.0f, -2.0f, 1.0f};
  const CurrentSetpoints limited = motor_currents(kPremium15, torque_N_m);
  EXPECT_LT(limited.scale, 1.0f);
  EXPECT_EQ(largest_A(limited.current_A), kPremium15.peak_current_A);
  const CurrentSetpoints small = motor_currents(kPremium15, torque_N_m * 0.01f);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(limited.current_A[i], small.current_A[i] * 100.0f * limited.scale, 1e-5f);
}

TEST(Actuation, NoSetPointExceedsThePeak) {
  float torque_N_m = 1.0f;
  for (int i = 0; i < 120; ++i, torque_N_m *= 2.0f)  // up to 2^119 = 7e35
    for (const Vec3f& direction : {Vec3f{1, 0, 0}, Vec3f{-1, 0.3f, 0}, Vec3f{0.1f, 1, -1}}) {
      const CurrentSetpoints setpoints = motor_currents(kPremium15, direction * torque_N_m);
      ASSERT_LE(largest_A(setpoints.current_A), kPremium15.peak_current_A);
      ASSERT_GT(setpoints.scale, 0.0f);
    }
}

TEST(Actuation, TorquesThatAreNoNumbersGiveNoCurrent) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::max()}) {
    const CurrentSetpoints setpoints = motor_currents(kPremium15, {0.1f, bad, 0.1f});
    EXPECT_EQ(setpoints.current_A, Vec3f{});
    EXPECT_EQ(setpoints.scale, 0.0f);
  }
}

TEST(Actuation, DataSheetForcesFitTheMotors) {
  const Pose reference = evaluate(kPremium15, {});
  for (const Vec3f& direction : {Vec3f{1, 0, 0}, Vec3f{0, 1, 0}, Vec3f{0, 0, 1}}) {
    const auto needed_A = [&](float force_N) {
      return largest_A(motor_currents(kPremium15, joint_torque(reference, direction * force_N)).current_A);
    };
    EXPECT_LT(needed_A(kPremium15.continuous_force_N), kPremium15.continuous_current_A);
    EXPECT_LT(needed_A(kPremium15.max_force_N), kPremium15.peak_current_A);
  }
}

}  // namespace
}  // namespace palpate::device
