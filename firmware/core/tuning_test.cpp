#include "firmware/core/tuning.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "firmware/core/servo.hpp"
#include "shared/device/arm.hpp"

namespace palpate::firmware {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

TEST(Tuning, TheDefaultWeightIsThatOfTheArm) {
  const device::Pose upright = device::evaluate(device::kPremium15, {0.0f, 0.0f, 1.5707963f});
  EXPECT_FLOAT_EQ(kNominalGravity_N_m.y, upright.gravity_torque_N_m.y);
  EXPECT_NEAR(kNominalGravity_N_m.z, upright.gravity_torque_N_m.z, 1e-8f);  // the sine is 1 to its last bits
}

TEST(Tuning, WhatIsOutOfRangeIsNotAllowed) {
  for (const TuningField& field : kTuningFields) {
    for (std::size_t i = 0; i < 3; ++i) {
      JointValues values = Tuning{}.*field.values;
      EXPECT_TRUE(is_allowed(field, values)) << field.name;
      values[i] = std::nextafter(field.most[i], 1e9f);
      EXPECT_FALSE(is_allowed(field, values)) << field.name;
      values[i] = std::nextafter(field.least[i], -1e9f);
      EXPECT_FALSE(is_allowed(field, values)) << field.name;
      values[i] = kNaN;
      EXPECT_FALSE(is_allowed(field, values)) << field.name;
    }
  }
  EXPECT_FALSE(is_allowed(kTuningFields[0], {1.0f, 0.5f, 1.0f}));  // a sign is 1 or -1
  EXPECT_TRUE(is_allowed(kTuningFields[0], {1.0f, -1.0f, 1.0f}));
}

TEST(Tuning, WhatIsPackedIsUnpacked) {
  Tuning tuning;
  tuning.encoder_sign[2] = -1.0f;
  tuning.monitor_offset_A = {0.1f, -0.2f, 0.3f};
  std::array<std::uint8_t, kTuningBytes> bytes;
  pack_tuning(tuning, bytes);
  Tuning read;
  ASSERT_TRUE(unpack_tuning(bytes, read));
  EXPECT_EQ(read, tuning);
}

TEST(Tuning, OfAnotherVersionOrOutOfRangeItIsNotRead) {
  Tuning tuning;
  std::array<std::uint8_t, kTuningBytes> bytes;
  pack_tuning(tuning, bytes);
  ++bytes[0];
  Tuning read;
  EXPECT_FALSE(unpack_tuning(bytes, read));
  tuning.setpoint_gain[1] = 2.0f;
  pack_tuning(tuning, bytes);
  EXPECT_FALSE(unpack_tuning(bytes, read));
  EXPECT_EQ(read, Tuning{});
}

// The friction of a joint does less than nothing: at no speed does the compensation give what friction takes.
TEST(Friction, TheCompensationNeverGivesMoreThanItsShareOfTheFriction) {
  const Tuning tuning{.coulomb_friction_N_m = {0.05f, 0.01f, 0.0f},
                      .viscous_friction_N_m_s = {2e-3f, 0.0f, 1e-3f},
                      .friction_share = {kMaxFrictionShare, kMaxFrictionShare, 0.5f}};
  for (const float speed_rad_s : {0.0f, 1e-4f, 0.01f, 0.05f, 0.3f, 2.0f, 10.0f, 50.0f}) {
    for (const float sign : {-1.0f, 1.0f}) {
      const float v = sign * speed_rad_s;
      const Vec3f torque_N_m = friction_compensation(tuning, {v, v, v});
      for (std::size_t i = 0; i < 3; ++i) {
        const float share = tuning.friction_share[i];
        const float friction_N_m = (speed_rad_s > 0.0f ? tuning.coulomb_friction_N_m[i] : 0.0f) +
                                   tuning.viscous_friction_N_m_s[i] * speed_rad_s;
        EXPECT_GE(sign * torque_N_m[i], 0.0f);
        EXPECT_LE(sign * torque_N_m[i], share * friction_N_m * (1.0f + 1e-6f));  // rounding of two products
      }
    }
  }
  const float largest_N_m = friction_compensation(tuning, {1e3f, 0, 0}).x;
  EXPECT_NEAR(largest_N_m, 0.056f, 1e-6f);  // as kMaxFrictionShare's comment says
}

class TunedServo : public ::testing::Test {
 protected:
  ServoOutput tick() {
    const ServoOutput output = servo_->isr_tick(timing_, sensors_);
    ++timing_.tick;
    return output;
  }
  ServoOutput ticks(int count) {
    ServoOutput output;
    for (int i = 0; i < count; ++i) output = tick();
    return output;
  }
  ServoOutput arm() {
    ticks(30);
    EXPECT_TRUE(mailbox_.commands.push({{Action::arm_request, 0}, {10, 1}}));
    tick();
    CommandReply reply;
    EXPECT_TRUE(mailbox_.replies.pop(reply));
    EXPECT_TRUE(mailbox_.commands.push({{Action::arm_confirm, reply.outcome.token}, {10, 2}}));
    return tick();
  }
  // From the next tick on.
  void use(const Tuning& tuning) { servo_->begin(tuning); }

  const Limits limits_{};
  Mailbox mailbox_{};
  std::unique_ptr<Renderer> renderer_ = std::make_unique<Renderer>(1, kCatchUpCortexM4);
  std::unique_ptr<Servo> servo_ =
      std::make_unique<Servo>(device::kPremium15, limits_, 1, *renderer_, mailbox_);
  ServoTiming timing_{};
  ServoSensors sensors_{};
};

TEST_F(TunedServo, AnEncoderTheOtherWayRoundTurnsTheJointTheSameWay) {
  Tuning tuning;
  tuning.encoder_sign = {-1.0f, 1.0f, -1.0f};
  sensors_.count = {100, 200, 300};
  const ServoOutput plain = ticks(3);
  use(tuning);
  sensors_.count = {-100, 200, -300};
  const ServoOutput turned = tick();
  EXPECT_EQ(plain.sample.tip_m, turned.sample.tip_m);
}

TEST_F(TunedServo, ASignThatChangesIsNoJump) {
  sensors_.count = {5000, 5000, 5000};
  ticks(40);
  Tuning tuning;
  tuning.encoder_sign = {-1.0f, -1.0f, -1.0f};
  use(tuning);
  EXPECT_EQ(ticks(3).faults, 0u);
}

TEST_F(TunedServo, SetpointsAreWhatTheAmplifiersNeed) {
  const ServoOutput plain = arm();
  ASSERT_TRUE(plain.outputs_on);
  ASSERT_NE(plain.setpoint_A[1], 0.0f);
  Tuning tuning;
  tuning.setpoint_offset_A = {0.1f, -0.2f, 0.3f};
  tuning.setpoint_gain = {1.1f, 0.9f, 1.0f};
  use(tuning);
  const ServoOutput tuned = tick();
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_FLOAT_EQ(tuned.setpoint_A[i],
                    tuning.setpoint_gain[i] * plain.setpoint_A[i] - tuning.setpoint_offset_A[i]);
  sensors_.emergency_stop_open = true;
  EXPECT_EQ(tick().setpoint_A, (std::array<float, 3>{}));
}

TEST_F(TunedServo, MonitorsAreCorrectedBeforeTheSupervisorJudgesThem) {
  ticks(30);
  const float limit_A = limits_.over_current_ratio * limits_.motor_current_A[0];
  sensors_.measured_current_A = {limit_A + 0.5f, 0.0f, 0.0f};
  Tuning tuning;
  tuning.monitor_offset_A = {1.0f, 0.0f, 0.0f};
  use(tuning);
  EXPECT_EQ(ticks(20).faults & bit(Fault::over_current), 0u);
  use({});
  EXPECT_NE(ticks(20).faults & bit(Fault::over_current), 0u);
}

// And comes with the soft start: a weight that is wrong is no jerk.
TEST_F(TunedServo, TheWeightIsThatOfTheTuning) {
  Tuning tuning;
  tuning.gravity_torque_N_m[1] = 2.0f * kNominalGravity_N_m.y;
  use(tuning);
  const float plain_A = arm().setpoint_A[1];
  ASSERT_NE(plain_A, 0.0f);
  for (std::uint32_t i = 1; i <= limits_.soft_start_ticks + 5; ++i) {
    const float share = std::min(1.0f, static_cast<float>(i) / static_cast<float>(limits_.soft_start_ticks));
    ASSERT_FLOAT_EQ(tick().setpoint_A[1], (1.0f + share) * plain_A) << i;
  }
}

// Whatever gain and offset say, no amplifier is told more than the limit; all three shrink by one factor.
TEST_F(TunedServo, NoAmplifierIsToldMoreThanTheLimit) {
  Limits limits;
  limits.motor_current_A = {1.0f, 1.0f, 0.2f};
  servo_ = std::make_unique<Servo>(device::kPremium15, limits, 1, *renderer_, mailbox_);
  sensors_.count = {0, 0, 0};
  Tuning tuning;
  tuning.gravity_torque_N_m = {0.0f, 0.3f, 0.3f};
  tuning.setpoint_gain = {1.0f, 1.0f, 1.25f};
  tuning.setpoint_offset_A = {0.0f, 0.0f, -0.05f};
  use(tuning);
  arm();
  // The forearm's weight grows with its angle; here it is within the workspace.
  const auto half_radian_count = static_cast<std::int32_t>(0.5f * device::kPremium15.joint[2].counts_per_rad);
  for (std::int32_t at = 0; at < half_radian_count; at += 10) {
    sensors_.count[2] = at;
    const ServoOutput output = tick();
    ASSERT_TRUE(output.outputs_on) << at << ": " << output.faults;
    ASSERT_LE(std::fabs(output.setpoint_A[2]), 0.2f * (1.0f + 1e-6f)) << at;
  }
  EXPECT_GT(std::fabs(tick().setpoint_A[2]), 0.19f);
}

TEST_F(TunedServo, ASignThatChangesLeavesTheReferencePoseWhereItIs) {
  sensors_.count = {5000, -3000, 700};
  ticks(40);
  EXPECT_TRUE(mailbox_.commands.push({{Action::calibrate, 0}, {10, 1}}));
  const ServoOutput calibrated = ticks(static_cast<int>(limits_.calibration_ticks) + 5);
  ASSERT_EQ(calibrated.mode, Mode::idle);
  ASSERT_EQ(calibrated.sample.tip_m, Vec3f{});
  Tuning tuning;
  tuning.encoder_sign = {-1.0f, 1.0f, -1.0f};
  use(tuning);
  EXPECT_EQ(ticks(3).sample.tip_m, Vec3f{});
}

// A joint that moves gets the current of its share of the friction, one at rest none.
TEST_F(TunedServo, FrictionIsCompensatedInMotionOnly) {
  Tuning tuning;
  tuning.coulomb_friction_N_m = {0.01f, 0.01f, 0.01f};
  tuning.friction_share = {0.5f, 0.5f, 0.5f};
  use(tuning);
  EXPECT_EQ(arm().setpoint_A[0], 0.0f);
  ServoOutput output;
  for (int i = 0; i < 100; ++i) {
    ++sensors_.count[0];  // 0.11 rad/s
    output = tick();
  }
  const device::Joint& joint = device::kPremium15.joint[0];
  const float wanted_A = 0.5f * 0.01f / (joint.transmission_ratio * device::kPremium15.torque_constant_N_m_A);
  EXPECT_NEAR(output.setpoint_A[0], wanted_A, 1e-6f);
  EXPECT_LT(std::fabs(ticks(200).setpoint_A[0]), 1e-6f);  // the estimate dies away
}

}  // namespace
}  // namespace palpate::firmware
