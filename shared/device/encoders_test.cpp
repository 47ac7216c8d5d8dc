#include "shared/device/encoders.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "shared/device/arm.hpp"

namespace palpate::device {
namespace {

Parameters with_sign(std::int8_t sign) {
  Parameters device = kPremium15;
  for (Joint& joint : device.joint) joint.encoder_sign = sign;
  return device;
}

TEST(Encoders, CountsSurviveTheRoundTrip) {
  // All counts of the largest joint range, 1.9 rad: 13,900, and far more.
  for (const std::int8_t sign : {std::int8_t{1}, std::int8_t{-1}}) {
    const Parameters device = with_sign(sign);
    for (std::int32_t count = -100'000; count <= 100'000; count += 7) {
      const Vec3f joint_rad = joint_angles(device, {count, count, count}, {});
      for (std::size_t i = 0; i < 3; ++i) ASSERT_EQ(encoder_count(device.joint[i], joint_rad[i]), count);
    }
  }
}

TEST(Encoders, AngleIsWithinHalfACount) {
  constexpr float kFloatError_counts = 0.01f;  // 14,000 counts * 2^-23, a few times
  constexpr int kSteps = 20'000;
  for (const Joint& joint : kPremium15.joint)
    for (int i = 0; i <= kSteps; ++i) {
      const float fraction = static_cast<float>(i) / static_cast<float>(kSteps);
      const float angle_rad = joint.min_rad + fraction * (joint.max_rad - joint.min_rad);
      const auto counts = static_cast<float>(encoder_count(joint, angle_rad));
      ASSERT_LE(std::fabs(counts - angle_rad * joint.counts_per_rad), 0.5f + kFloatError_counts);
    }
}

TEST(Encoders, ReferenceIsSubtracted) {
  const EncoderCounts reference{1000, -2000, 123'456};
  EXPECT_EQ(joint_angles(kPremium15, reference, reference), Vec3f{});
  const EncoderCounts shifted{1000 + 50, -2000 - 60, 123'456 + 70};
  EXPECT_EQ(joint_angles(kPremium15, shifted, reference), joint_angles(kPremium15, {50, -60, 70}, {}));
}

TEST(Encoders, CountersMayWrapAround) {
  constexpr std::int32_t kLargest = std::numeric_limits<std::int32_t>::max();
  constexpr std::int32_t kSmallest = std::numeric_limits<std::int32_t>::min();
  const Vec3f joint_rad =
      joint_angles(kPremium15, {kSmallest + 9, kSmallest, kLargest}, {kLargest, kLargest, kSmallest});
  EXPECT_EQ(joint_rad, joint_angles(kPremium15, {10, 1, -1}, {}));
}

TEST(Encoders, CountStopsAtTheEndsOfTheCounter) {
  EXPECT_EQ(encoder_count(kPremium15.joint[0], 1e9), std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(encoder_count(kPremium15.joint[0], -1e9f), std::numeric_limits<std::int32_t>::min());
  EXPECT_EQ(encoder_count(kPremium15.joint[0], std::nan("")), std::numeric_limits<std::int32_t>::min());
}

TEST(Encoders, TipResolutionIsThatOfTheDataSheet) {
  // Data sheet: 0.03 mm nominal. One count of each joint moves the tip at the reference pose by:
  for (std::size_t i = 0; i < 3; ++i) {
    EncoderCounts one_count{};
    one_count[i] = 1;
    const float moved_m = norm(forward_kinematics(kPremium15, joint_angles(kPremium15, one_count, {})));
    EXPECT_GT(moved_m, 0.02e-3f);
    EXPECT_LT(moved_m, 0.0305e-3f);
  }
}

}  // namespace
}  // namespace palpate::device
