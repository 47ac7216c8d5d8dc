#include "firmware/core/servo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "firmware/core/renderer_test_support.hpp"
#include "firmware/test_support.hpp"
#include "palpate/ServoSample_1_0.h"
#include "shared/device/actuation.hpp"

namespace palpate::firmware {
namespace {

const device::Parameters& kDevice = device::kPremium15;
constexpr std::array<float, 3> kLargest_A = kDefaultLimits.motor_current_A;
// float32 through sines, a 3x3 product and its solution, on torques of some 0.1 N m.
constexpr float kForceRounding_N = 1e-4f;

device::EncoderCounts counts_at(const Vec3f& joint_rad) {
  device::EncoderCounts count{};
  for (std::size_t i = 0; i < 3; ++i) count[i] = device::encoder_count(kDevice.joint[i], joint_rad[i]);
  return count;
}

// The force that these currents make the tip exert, without the part that carries the arm.
Vec3f tip_force(const device::Pose& pose, const std::array<float, 3>& current_A) {
  Vec3f torque_N_m{};
  for (std::size_t i = 0; i < 3; ++i) {
    torque_N_m[i] = current_A[i] * kDevice.joint[i].transmission_ratio * kDevice.torque_constant_N_m_A;
  }
  Vec3f force_N{};
  EXPECT_TRUE(solve(transpose(pose.jacobian_m), torque_N_m - pose.gravity_torque_N_m, force_N));
  return force_N;
}

TEST(ReactionCurrents, PushTheTipAgainstTheForceOnTheBody) {
  for (const Vec3f& joint_rad : {Vec3f{0, 0, 0}, Vec3f{0.5f, 0.4f, 0.3f}, Vec3f{-0.7f, 0.2f, 0.9f}}) {
    const device::Pose pose = device::evaluate(kDevice, joint_rad);
    for (const Vec3f& force_N : {Vec3f{1, 0, 0}, Vec3f{0, -2, 0}, Vec3f{0.3f, 0.4f, -1.5f}}) {
      const CurrentLimit result = reaction_currents(kDevice, pose, force_N, kLargest_A);
      ASSERT_TRUE(result.finite);
      ASSERT_FALSE(result.limited);
      const Vec3f exerted_N = tip_force(pose, result.setpoint_A);
      EXPECT_LT(norm(exerted_N + force_N), kForceRounding_N);
    }
  }
}

TEST(ReactionCurrents, CarryTheArmWithoutForce) {
  const device::Pose pose = device::evaluate(kDevice, {0.1f, 0.2f, 0.3f});
  const CurrentLimit result = reaction_currents(kDevice, pose, {}, kLargest_A);
  EXPECT_GT(std::fabs(result.setpoint_A[1]), 0.0f);
  EXPECT_LT(norm(tip_force(pose, result.setpoint_A)), kForceRounding_N);
}

TEST(ReactionCurrents, StayWithinLimits) {
  const device::Pose pose = device::evaluate(kDevice, {0.1f, 0.2f, 0.3f});
  for (const float force_N : {5.0f, 50.0f}) {  // beyond the limits; beyond those of the device, too
    const CurrentLimit result =
        reaction_currents(kDevice, pose, {force_N, force_N, force_N}, {0.5f, 0.5f, 0.5f});
    EXPECT_TRUE(result.limited);
    for (const float current_A : result.setpoint_A) EXPECT_LE(std::fabs(current_A), 0.5f);
  }
}

TEST(ReactionCurrents, NotFiniteIsReported) {
  const device::Pose pose = device::evaluate(kDevice, {});
  EXPECT_FALSE(reaction_currents(kDevice, pose, {NAN, 0, 0}, kLargest_A).finite);
  EXPECT_FALSE(reaction_currents(kDevice, pose, {0, INFINITY, 0}, kLargest_A).finite);
}

class ServoTest : public ::testing::Test {
 protected:
  ServoOutput tick(std::uint32_t elapsed = 1) {
    timing_.elapsed_ticks = elapsed;
    const ServoOutput output = servo_->isr_tick(timing_, sensors_);
    sensors_.measured_current_A = output.setpoint_A;  // of ideal amplifiers
    timing_.tick += 1;
    return output;
  }
  ServoOutput ticks(std::uint32_t count) {
    ServoOutput output;
    for (std::uint32_t i = 0; i < count; ++i) output = tick();
    return output;
  }
  CommandReply command(Action action, std::uint32_t token = 0) {
    EXPECT_TRUE(mailbox_.commands.push({{action, token}, {10, 77}}));
    last_ = tick();
    CommandReply reply;
    EXPECT_TRUE(mailbox_.replies.pop(reply));
    EXPECT_EQ(reply.outcome.action, action);
    EXPECT_EQ(reply.requester.transfer_id, 77u);
    return reply;
  }
  void arm() {
    ticks(limits_.boot_ticks);
    const CommandReply challenge = command(Action::arm_request);
    ASSERT_EQ(command(Action::arm_confirm, challenge.outcome.token).outcome.status, Status::ok);
  }
  // Moves the joints to an angle in steps that no limit minds.
  void move_to(const Vec3f& from_rad, const Vec3f& to_rad, std::uint32_t steps) {
    for (std::uint32_t i = 1; i <= steps; ++i) {
      sensors_.count =
          counts_at(from_rad + (to_rad - from_rad) * (static_cast<float>(i) / static_cast<float>(steps)));
      last_ = tick();
    }
  }
  void give_model(const wire::ModelContents& message) {
    ModelReport report;
    ASSERT_EQ(test::deliver(*renderer_, message, report), Status::ok);
    for (int i = 0; i < 50 && renderer_->model_sequence() != message.sequence; ++i) {
      (void)renderer_->catch_up(report);
      last_ = tick();
    }
    ASSERT_EQ(renderer_->model_sequence(), message.sequence);
  }

  const Limits limits_{};
  Mailbox mailbox_{};
  std::unique_ptr<Renderer> renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
  std::unique_ptr<Servo> servo_ = std::make_unique<Servo>(kDevice, limits_, 1u, *renderer_, mailbox_);
  ServoTiming timing_{};
  ServoSensors sensors_{};
  ServoOutput last_{};
};

TEST_F(ServoTest, KnowsTheTipFromTheCounts) {
  const Vec3f joint_rad{0.1f, 0.15f, 0.2f};
  move_to({}, joint_rad, 50);
  const Vec3f expected_m =
      device::forward_kinematics(kDevice, device::joint_angles(kDevice, sensors_.count, {}));
  EXPECT_EQ(last_.sample.tip_m, expected_m);
  ServoSample sample;
  ASSERT_TRUE(servo_->sample(timing_.tick - 1, sample));
  EXPECT_EQ(sample.tip_m, expected_m);
  EXPECT_FALSE(servo_->sample(timing_.tick, sample));
}

TEST_F(ServoTest, OutputsAreOffUntilArmed) {
  ServoOutput output = ticks(200);
  EXPECT_FALSE(output.outputs_on);
  EXPECT_EQ(output.setpoint_A, (std::array<float, 3>{}));
  const CommandReply challenge = command(Action::arm_request);
  EXPECT_FALSE(last_.outputs_on);
  EXPECT_EQ(command(Action::arm_confirm, challenge.outcome.token).mode, Mode::render);
  EXPECT_TRUE(last_.outputs_on);
}

TEST_F(ServoTest, WithoutAModelItOnlyCarriesTheArm) {
  arm();
  const ServoOutput output = ticks(200);
  EXPECT_TRUE(output.outputs_on);
  EXPECT_LT(norm(tip_force(device::evaluate(kDevice, {}), output.setpoint_A)), kForceRounding_N);
  EXPECT_EQ(output.sample.flags & palpate_ServoSample_1_0_FLAG_MODEL_USED, 0);
}

TEST_F(ServoTest, TheHandFeelsTheBodyPushBack) {
  arm();
  ticks(limits_.soft_start_ticks);
  give_model(test::square_model(3, timing_.tick - 1, {0.0f, 0.0f, -0.002f}));
  // Down by about 4 mm, 2 mm into the body.
  move_to({}, {0.0f, -0.019f, 0.0f}, 20);
  const ServoOutput output = ticks(20);
  ASSERT_TRUE(output.outputs_on);
  ASSERT_NE(output.sample.mode, ContactMode::free);
  EXPECT_LT(output.sample.force_N.z, -0.05f);  // the tip presses the body down
  EXPECT_EQ(output.force_N, output.sample.force_N);
  const device::Pose pose = device::evaluate(kDevice, device::joint_angles(kDevice, sensors_.count, {}));
  const Vec3f exerted_N = tip_force(pose, output.setpoint_A);
  EXPECT_LT(norm(exerted_N + output.force_N), kForceRounding_N);
  EXPECT_GT(exerted_N.z, 0.05f);  // the motors push the tip up
  ServoSample sample;
  ASSERT_TRUE(servo_->sample(timing_.tick - 1, sample));
  EXPECT_EQ(sample.flags, palpate_ServoSample_1_0_FLAG_RENDERING | palpate_ServoSample_1_0_FLAG_MODEL_USED);
}

// The model decides whether the renderer is told the tip of the counts or the one between them.
TEST_F(ServoTest, TheModelChoosesWhereTheTipIs) {
  const auto tip_of_counts = [this] {
    return device::forward_kinematics(kDevice, device::joint_angles(kDevice, sensors_.count, {}));
  };
  arm();
  auto message = test::square_model(1, timing_.tick - 1, {0.0f, 0.0f, -0.01f});
  give_model(message);
  move_to({}, {0.001f, 0.001f, 0.001f}, 200);
  EXPECT_EQ(last_.sample.tip_m, tip_of_counts());

  message.sequence = 2;
  message.tick = timing_.tick - 1;
  message.tip_source = palpate_ModelState_1_0_TIP_ESTIMATED;
  give_model(message);
  // Two counts of each joint, 0.03 mm a count and joint.
  constexpr float kFarthest_m = 3 * 2 * 0.03e-3f;
  bool differs = false;
  for (int i = 0; i < 400; ++i) {
    sensors_.count = counts_at(Vec3f{1, 1, 1} * (0.001f + 1e-5f * static_cast<float>(i)));
    const ServoOutput output = tick();
    EXPECT_LT(norm(output.sample.tip_m - tip_of_counts()), kFarthest_m);
    differs = differs || norm(output.sample.tip_m - tip_of_counts()) > 0.2f * 0.03e-3f;
  }
  EXPECT_TRUE(differs);
  // A count that toggles moves the estimate to the border of both, where it stays.
  const device::EncoderCounts rest = sensors_.count;
  for (int i = 0; i < 600; ++i) {
    sensors_.count[1] = rest[1] + i % 2;
    last_ = tick();
  }
  const Vec3f held_m = last_.sample.tip_m;
  for (int i = 0; i < 100; ++i) {
    sensors_.count[1] = rest[1] + i % 2;
    constexpr float kStill_m = 1e-7f;
    EXPECT_LT(norm(tick().sample.tip_m - held_m), kStill_m);
  }
}

// A model takes over, and from its second tick on the tip is the estimated one or that of the counts, as it
// asks for. Where that is another one than before, tip and force step.
class TipSourceChange : public ServoTest, public ::testing::WithParamInterface<float> {
 protected:
  static constexpr std::uint8_t kCounts = palpate_ModelState_1_0_TIP_COUNTS,
                                kEstimated = palpate_ModelState_1_0_TIP_ESTIMATED;
  struct Taken {
    ServoSample last, next;  // the model's first tick and its second
    float stiffness_N_m;     // of the point in contact
  };
  void go(std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      // Down onto the body within the 60 ticks before the first model, and slowly around.
      const float t = static_cast<float>(timing_.tick);
      const float down = std::clamp((t - pressed_tick_) / 60.0f + 1.0f, 0.0f, 1.0f);
      sensors_.count =
          counts_at({0.004f * std::sin(0.005f * t), -0.014f * down + 0.0005f * std::sin(0.013f * t),
                     0.003f * std::sin(0.007f * t)});
      last_ = tick();
    }
  }
  // Offers the model and goes on until it is used; the one that is returned has been stepped as it was.
  std::unique_ptr<test::Reference> take_over(const wire::ModelContents& message) {
    ServoSample sample;
    EXPECT_TRUE(servo_->sample(message.tick, sample));
    auto follower = std::make_unique<test::Reference>(message, sample.tip_m);
    ModelReport report;
    EXPECT_EQ(test::deliver(*renderer_, message, report), Status::ok);
    for (int i = 0; i < 100 && renderer_->model_sequence() != message.sequence; ++i) {
      (void)renderer_->catch_up(report);
      go(1);
    }
    EXPECT_EQ(renderer_->model_sequence(), message.sequence);
    for (std::uint32_t t = message.tick + 1; t != timing_.tick; ++t) {
      EXPECT_TRUE(servo_->sample(t, sample));
      (void)follower->step(sample.tip_m);
    }
    EXPECT_EQ(follower->contact().force_N, last_.sample.force_N);
    return follower;
  }
  // Models with these sources, one after the other; the last one's first ticks.
  Taken run(std::uint32_t start, const std::vector<std::uint8_t>& sources) {
    timing_ = {};
    sensors_ = {};
    renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
    servo_ = std::make_unique<Servo>(kDevice, limits_, 1u, *renderer_, mailbox_);
    pressed_tick_ = static_cast<float>(start);
    go(start);
    // The first one begins before the tip has touched, and replays that.
    auto message = test::square_model(1, start - 80, {0.0f, 0.0f, -0.002f});
    std::fill_n(message.static_friction.elements, message.static_friction.count, GetParam());
    std::fill_n(message.kinetic_friction.elements, message.kinetic_friction.count, GetParam());
    Taken taken{};
    for (const std::uint8_t source : sources) {
      message.tip_source = source;
      const auto follower = take_over(message);
      taken.last = last_.sample;
      taken.stiffness_N_m = follower->stiffness_N_m();
      go(1);
      taken.next = last_.sample;
      EXPECT_EQ(follower->step(taken.next.tip_m).force_N, taken.next.force_N);
      message = follower->as_it_is(message.sequence + 1, timing_.tick - 1);
    }
    return taken;
  }
  // The last of two runs that differ in its source only.
  void compare(std::uint32_t start, const std::vector<std::uint8_t>& before, std::uint8_t from,
               std::uint8_t to) {
    std::vector<std::uint8_t> stays = before, changes = before;
    stays.push_back(from);
    changes.push_back(to);
    const Taken same = run(start, stays), other = run(start, changes);
    ASSERT_NE(same.last.mode, ContactMode::free);
    ASSERT_EQ(same.last.force_N, other.last.force_N);
    const float step_m = norm(other.next.tip_m - same.next.tip_m);
    const float step_N = norm(other.next.force_N - same.next.force_N);
    constexpr float kFarthest_m = 3 * 2 * 0.03e-3f;  // two counts of each joint, 0.03 mm each
    EXPECT_LE(step_m, kFarthest_m);
    EXPECT_LE(step_N, same.stiffness_N_m * step_m + kForceRounding_N) << start;
    largest_m_ = std::max(largest_m_, step_m);
    largest_N_ = std::max(largest_N_, step_N);
  }
  float pressed_tick_ = 0, largest_m_ = 0, largest_N_ = 0;
};

TEST_P(TipSourceChange, StepsTheForceByWhatTheComplianceAllows) {
  for (std::uint32_t start = 100; start < 500; start += 7) {
    compare(start, {}, kCounts, kEstimated);
    compare(start, {kCounts}, kCounts, kEstimated);
    compare(start, {kEstimated}, kEstimated, kCounts);
  }
  // More than a count of one joint, and a force that is felt.
  EXPECT_GT(largest_m_, 0.03e-3f);
  EXPECT_GT(largest_N_, 0.1f);
}
INSTANTIATE_TEST_SUITE_P(Friction, TipSourceChange, ::testing::Values(0.0f, 100.0f));

TEST_F(ServoTest, LimitedForceIsFlaggedAndRecordedBeforeLimits) {
  arm();  // soft start begins
  give_model(test::square_model(3, timing_.tick - 1, {0.0f, 0.0f, -0.002f}));
  move_to({}, {0.0f, -0.019f, 0.0f}, 20);
  ASSERT_GT(norm(last_.sample.force_N), norm(last_.force_N));
  ServoSample sample;
  ASSERT_TRUE(servo_->sample(timing_.tick - 1, sample));
  EXPECT_EQ(sample.force_N, last_.sample.force_N);
  EXPECT_NE(sample.flags & palpate_ServoSample_1_0_FLAG_LIMITED, 0);
}

// A model from before the tip was pressed, whose body is higher: it would have asked for more on the way in.
TEST_F(ServoTest, WhatACorrectionHasGivenTooMuchIsTakenBack) {
  static constexpr Limits kEager{.passivity_allowance_J = 0.0f};
  servo_ = std::make_unique<Servo>(kDevice, kEager, 1u, *renderer_, mailbox_);
  arm();
  ticks(kEager.soft_start_ticks);
  give_model(test::square_model(3, timing_.tick - 1, {0.0f, 0.0f, -0.002f}));
  ticks(10);
  const std::uint32_t before = timing_.tick - 1;
  const Vec3f pressed_rad{0.0f, -0.019f, 0.0f};
  move_to({}, pressed_rad, 20);
  EXPECT_EQ(last_.force_N, last_.sample.force_N);
  give_model(test::square_model(4, before, {0.0f, 0.0f, -0.001f}));
  ASSERT_GT(renderer_->correction_energy_J(), 0.0f);
  float taken_J = 0.0f;
  Vec3f tip_m = last_.sample.tip_m, added_N{};
  for (std::uint32_t i = 1; i <= 20; ++i) {
    sensors_.count = counts_at(pressed_rad * (1.0f - static_cast<float>(i) / 20.0f));
    last_ = tick();
    taken_J += dot(added_N, last_.sample.tip_m - tip_m);
    tip_m = last_.sample.tip_m;
    added_N = last_.force_N - last_.sample.force_N;
    ASSERT_LE(norm(added_N), kEager.damping_force_N + kForceRounding_N);
  }
  EXPECT_GT(taken_J, 0.5f * renderer_->correction_energy_J());
}

TEST_F(ServoTest, EmergencyStopActsWithinItsTick) {
  arm();
  ticks(10);
  sensors_.emergency_stop_open = true;
  const ServoOutput output = tick();
  EXPECT_FALSE(output.outputs_on);
  EXPECT_EQ(output.setpoint_A, (std::array<float, 3>{}));
  EXPECT_EQ(output.faults, bit(Fault::emergency_stop));
}

TEST_F(ServoTest, AnEncoderJumpIsAFault) {
  ticks(limits_.boot_ticks);
  sensors_.count = counts_at({0.0f, 0.0f, limits_.joint_step_rad + 0.001f});
  EXPECT_EQ(tick().faults, bit(Fault::encoder_jump));
}

TEST_F(ServoTest, MotionOverLostTicksIsNoJump) {
  ticks(limits_.boot_ticks);
  sensors_.count = counts_at({0.0f, 0.0f, limits_.joint_step_rad + 0.001f});
  timing_.tick += 1;
  EXPECT_EQ(tick(2).faults, 0);
}

TEST_F(ServoTest, OverSpeedSwitchesOffOnlyWhileRendering) {
  // 0.02 rad in a tick: 4 m/s at the upper arm's end.
  ticks(limits_.boot_ticks);
  sensors_.count = counts_at({0.0f, 0.02f, 0.0f});
  EXPECT_EQ(tick().mode, Mode::idle);
  ticks(5);
  const CommandReply challenge = command(Action::arm_request);
  command(Action::arm_confirm, challenge.outcome.token);
  sensors_.count = counts_at({0.0f, 0.04f, 0.0f});
  EXPECT_EQ(tick().faults, bit(Fault::over_speed));
}

TEST_F(ServoTest, LeavingTheWorkspaceSwitchesOff) {
  arm();
  move_to({}, {1.25f, 0.0f, 0.0f}, 400);  // beyond joint 1's limit of 1.2 rad
  EXPECT_EQ(last_.faults, bit(Fault::outside_workspace));
  EXPECT_FALSE(last_.outputs_on);
}

TEST_F(ServoTest, AnUnknowablePoseIsAFaultAndNoNumber) {
  ticks(limits_.boot_ticks);
  sensors_.count = {INT32_MAX, INT32_MIN, 1};
  const ServoOutput output = tick();
  EXPECT_FALSE(output.outputs_on);
  EXPECT_EQ(output.faults, bit(Fault::not_a_number) | bit(Fault::encoder_jump));
  EXPECT_TRUE(is_finite(output.sample.tip_m));
}

TEST_F(ServoTest, CalibrationMakesThePresentPoseTheReference) {
  const Vec3f joint_rad{0.1f, 0.2f, 0.3f};
  move_to({}, joint_rad, 100);
  EXPECT_GT(norm(last_.sample.tip_m), 0.01f);
  EXPECT_EQ(command(Action::calibrate).mode, Mode::calibrate);
  ticks(limits_.calibration_ticks);
  const ServoOutput output = tick();
  EXPECT_EQ(output.mode, Mode::idle);
  EXPECT_EQ(output.sample.tip_m, (device::forward_kinematics(kDevice, {})));
  // The tip has changed its place in the numbers only: arming is not refused for speed.
  EXPECT_EQ(command(Action::arm_request).outcome.status, Status::ok);
}

TEST_F(ServoTest, CalibrationToleratesFlickerButNotDrift) {
  ticks(limits_.boot_ticks);
  command(Action::calibrate);
  for (std::uint32_t i = 0; i < limits_.calibration_ticks; ++i) {
    sensors_.count[0] = static_cast<std::int32_t>(i % 2);
    ASSERT_EQ(tick().faults, 0);
  }
  EXPECT_EQ(tick().mode, Mode::idle);

  command(Action::calibrate);
  const std::int32_t start = sensors_.count[0];
  sensors_.count[0] = start + 1;
  EXPECT_EQ(tick().mode, Mode::calibrate);
  sensors_.count[0] = start + 2;  // one count a tick is no rest
  EXPECT_EQ(tick().mode, Mode::idle);
}

TEST_F(ServoTest, CalibrationForgetsTheModel) {
  ticks(limits_.boot_ticks);
  give_model(test::square_model(3, timing_.tick - 1, {0.0f, 0.0f, -0.002f}));
  command(Action::calibrate);
  ticks(limits_.calibration_ticks + 1);
  EXPECT_EQ(renderer_->model_sequence(), 0u);
}

TEST_F(ServoTest, PostsStatusPeriodicallyAndAtEachChangeOfMode) {
  std::vector<StatusSnapshot> posted;
  const auto drain = [&] {
    for (StatusSnapshot snapshot; mailbox_.status.pop(snapshot);) posted.push_back(snapshot);
  };
  for (int i = 0; i < 250; ++i) {
    tick();
    drain();
  }
  ASSERT_EQ(posted.size(), 4u);  // ticks 0, 19 (idle), 100, 200
  EXPECT_EQ(posted[0].tick, 0u);
  EXPECT_EQ(posted[1].tick, limits_.boot_ticks - 1);
  EXPECT_EQ(posted[1].mode, Mode::idle);
  EXPECT_EQ(posted[3].tick, 200u);
  command(Action::stop);
  drain();
  ASSERT_EQ(posted.size(), 5u);
  EXPECT_EQ(posted[4].faults, bit(Fault::stop_command));
}

TEST_F(ServoTest, AFullStatusRingDelaysButDoesNotLoseTheNews) {
  ticks(2000);  // nobody reads: the ring is full of old snapshots
  command(Action::stop);
  std::vector<StatusSnapshot> posted;
  for (StatusSnapshot snapshot; mailbox_.status.pop(snapshot);) posted.push_back(snapshot);
  EXPECT_EQ(posted.back().faults, 0);
  tick();
  StatusSnapshot snapshot;
  ASSERT_TRUE(mailbox_.status.pop(snapshot));
  EXPECT_EQ(snapshot.faults, bit(Fault::stop_command));
}

TEST_F(ServoTest, HistoryHasNoHolesAfterLostTicks) {
  ticks(10);
  timing_.tick += 3;
  tick(4);
  for (std::uint32_t t = 0; t < timing_.tick; ++t) {
    ServoSample sample;
    EXPECT_TRUE(servo_->sample(t, sample)) << t;
  }
}

}  // namespace
}  // namespace palpate::firmware
