// The board as a plain device: forces of a program in place of a model's (Mode::direct).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/core/servo.hpp"
#include "firmware/core/supervisor.hpp"
#include "firmware/link/endpoint.hpp"
#include "firmware/test_support.hpp"
#include "shared/device/actuation.hpp"
#include "shared/device/arm.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kSeed = 0x12345678u;
// Rounding of the limited force: a few operations on numbers up to 10 N.
constexpr float kForceRounding_N = 4e-6f;
const device::Parameters& kDevice = device::kPremium15;

// A supervisor that is armed for a program's forces.
struct Armed {
  Limits limits{};
  SupervisorState state{};
  SupervisorInputs in{};
  Decision last{};

  Armed() {
    for (std::uint32_t i = 0; i < limits.boot_ticks; ++i) step();
    in.command = {Action::arm_direct, 0};
    step();
    in.command = {Action::arm_confirm, state.token};
    step();
  }
  Decision step() {
    last = supervise(state, in, limits, kSeed);
    state = last.state;
    in.command = {};
    ++in.tick;
    if (in.direct_age_ticks != UINT32_MAX) ++in.direct_age_ticks;
    return last;
  }
  // A force that comes in every tick.
  void hold(const Vec3f& force_N, std::uint32_t ticks) {
    for (std::uint32_t i = 0; i < ticks; ++i) {
      in.direct_force_N = force_N;
      in.direct_age_ticks = 0;
      step();
    }
  }
};

TEST(DirectForce, ArmsInTwoStepsOfItsOwn) {
  const Armed board;
  EXPECT_EQ(board.state.mode, Mode::direct);
  EXPECT_TRUE(board.last.outputs_on);
  EXPECT_EQ(board.state.force_N, Vec3f{});
}

TEST(DirectForce, IsRenderedToTheBitOnceItHasStarted) {
  Armed board;
  const Vec3f force_N{0.5f, -1.0f, 2.0f};
  board.hold(force_N, board.limits.soft_start_ticks + 10);
  EXPECT_EQ(board.state.force_N, force_N);
  EXPECT_FALSE(board.last.force_limited);
}

TEST(DirectForce, HasLimitsOfItsOwn) {
  Armed board;
  board.hold({}, board.limits.soft_start_ticks + 1);
  Vec3f before{};
  for (int i = 0; i < 30; ++i) {
    board.hold({0.0f, 8.0f, 0.0f}, 1);
    EXPECT_LE(norm(board.state.force_N - before), board.limits.direct_force_step_N + kForceRounding_N);
    before = board.state.force_N;
  }
  EXPECT_NEAR(board.state.force_N.y, board.limits.direct_force_N, kForceRounding_N);
  EXPECT_TRUE(board.last.force_limited);
  EXPECT_LT(board.limits.direct_force_N, board.limits.peak_force_N);
}

TEST(DirectForce, AModelIsNotFelt) {
  Armed board;
  board.in.force_N = {1.0f, 0.0f, 0.0f};
  board.in.model_sequence = 1;
  board.in.model_valid_ticks = 1000;
  for (int i = 0; i < 200; ++i) EXPECT_EQ(board.step().state.force_N, Vec3f{});
}

TEST(DirectForce, IsNotFeltWhileAModelIsRendered) {
  Armed board;
  board.in.command = {Action::disarm, 0};
  board.step();
  EXPECT_FALSE(board.last.outputs_on);
  board.in.command = {Action::arm_request, 0};
  board.step();
  board.in.command = {Action::arm_confirm, board.state.token};
  board.step();
  ASSERT_EQ(board.state.mode, Mode::render);
  board.hold({1.0f, 0.0f, 0.0f}, 200);
  EXPECT_EQ(board.state.force_N, Vec3f{});
}

// A step of the tip with each force, as the servo tells it: from the tick before to this one.
void push_along(Armed& board, const Vec3f& force_N, const Vec3f& tip_step_m, std::uint32_t ticks) {
  board.in.tip_step_m = tip_step_m;
  board.hold(force_N, ticks);
}

// The farthest that two places of the arm's workspace are apart, within a step of the joints' grid.
float workspace_m() {
  constexpr int kSteps = 12;
  std::vector<Vec3f> places;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        const std::array<int, 3> at{i, j, k};
        Vec3f joint_rad{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const device::Joint& joint = kDevice.joint[axis];
          joint_rad[axis] =
              joint.min_rad + (joint.max_rad - joint.min_rad) * static_cast<float>(at[axis]) / kSteps;
        }
        const device::Pose pose = device::evaluate(kDevice, joint_rad);
        if (pose.faults == 0) places.push_back(pose.tip_m);
      }
    }
  }
  float farthest_m = 0.0f;
  for (const Vec3f& a : places)
    for (const Vec3f& b : places) farthest_m = std::max(farthest_m, norm(a - b));
  return farthest_m;
}

TEST(DirectForce, AConstantForceOverTheWholeWorkspaceIsAllowed) {
  const float farthest_m = workspace_m();
  EXPECT_GT(farthest_m, 0.6f);
  for (const float speed_m_s : {0.05f, 1.0f}) {
    Armed board;
    const auto ticks = static_cast<std::uint32_t>(farthest_m / speed_m_s * 1e3f);
    for (int stroke = 0; stroke < 10; ++stroke) {
      push_along(board, {0.0f, 0.0f, 5.0f}, {0.0f, 0.0f, -1e-3f * speed_m_s}, ticks);
      ASSERT_TRUE(board.last.outputs_on) << speed_m_s << " m/s: " << board.state.energy_J << " J";
      push_along(board, {0.0f, 0.0f, 5.0f}, {0.0f, 0.0f, 1e-3f * speed_m_s}, ticks);
      ASSERT_TRUE(board.last.outputs_on) << speed_m_s << " m/s: " << board.state.energy_J << " J";
    }
  }
}

// Strokes of 1 m/s at the most against a wall of 1 kN/m that a program with 20 ms of delay renders, 5 N at
// most: what the delay creates in each of them leaks away.
TEST(DirectForce, AStiffWallOfALateProgramIsAllowed) {
  constexpr float kStiffness_N_m = 1000.0f, kAmplitude_m = 0.1f, kSpeed_m_s = 1.0f;
  constexpr std::size_t kDelay_ticks = 20;
  Armed board;
  std::array<float, kDelay_ticks> asked_N{};
  float depth_m = 0.0f, most_J = 0.0f;
  for (std::uint32_t tick = 0; tick < 30'000; ++tick) {
    const float next_m =
        kAmplitude_m * std::sin(kSpeed_m_s / kAmplitude_m * 1e-3f * static_cast<float>(tick));
    float& slot_N = asked_N[tick % kDelay_ticks];
    push_along(board, {0.0f, 0.0f, slot_N}, {0.0f, 0.0f, next_m - depth_m}, 1);
    depth_m = next_m;
    slot_N = std::clamp(kStiffness_N_m * depth_m, 0.0f, board.limits.direct_force_N);
    most_J = std::max(most_J, board.state.energy_J);
    ASSERT_TRUE(board.last.outputs_on) << tick << ": " << most_J << " J";
  }
  EXPECT_GT(most_J, 0.1f);  // it does create some, and takes back what it stored
}

TEST(DirectForce, AProgramThatPushesTheHandForEverIsAFault) {
  // With the velocity, to and fro: as a damper whose sign is wrong. 5 N at 0.5 m/s, 2.5 W.
  Armed board;
  board.hold({}, board.limits.soft_start_ticks);
  std::uint32_t on = 0;
  for (float sign = 1.0f; board.last.outputs_on; ++on) {
    ASSERT_LT(on, 10'000u);
    if (on % 400 == 0) sign = -sign;  // strokes of 20 cm
    push_along(board, {-5.0f * sign, 0.0f, 0.0f}, {0.5e-3f * sign, 0.0f, 0.0f}, 1);
  }
  EXPECT_EQ(board.state.faults, bit(Fault::energy_created));
  EXPECT_EQ(board.state.force_N, Vec3f{});
  // Force turns by 0.5 N a tick, within 20 ms: what it would give in them is missing, at the beginning and at
  // each of five turns at most.
  const float fill_W = 2.5f - board.limits.energy_leak_W;
  const float expected_s = board.limits.direct_energy_J / fill_W, turn_s = 0.02f * 2.5f / fill_W;
  EXPECT_GT(static_cast<float>(on) * 1e-3f, expected_s);
  EXPECT_LT(static_cast<float>(on) * 1e-3f, expected_s + 6 * turn_s);
}

TEST(DirectForce, APushOfHalfAWattIsAllowedForEver) {
  Armed board;
  push_along(board, {0.0f, -1.0f, 0.0f}, {0.0f, 0.49e-3f, 0.0f}, 20'000);
  EXPECT_TRUE(board.last.outputs_on);
  EXPECT_EQ(board.state.faults, 0);
}

TEST(DirectForce, FadesWhenTheProgramIsLateAndOutputsGoOffWhenItHasGone) {
  Armed board;
  const Vec3f force_N{0.0f, 0.0f, 3.0f};
  board.hold(force_N, board.limits.soft_start_ticks + 10);
  float before_N = norm(force_N);
  for (std::uint32_t age = 1; age <= board.limits.direct_lost_ticks; ++age) {
    board.step();
    ASSERT_TRUE(board.last.outputs_on) << age;
    const float now_N = norm(board.state.force_N);
    ASSERT_LE(now_N, before_N);
    if (age <= board.limits.direct_hold_ticks) {
      ASSERT_EQ(board.state.force_N, force_N) << age;
    }
    if (age > board.limits.direct_hold_ticks + board.limits.direct_fade_ticks) {
      ASSERT_EQ(now_N, 0.0f) << age;
    }
    before_N = now_N;
  }
  board.step();
  EXPECT_FALSE(board.last.outputs_on);
  EXPECT_EQ(board.state.mode, Mode::idle);
  EXPECT_EQ(board.state.faults, 0);
  board.hold(force_N, 10);  // coming back it has to arm
  EXPECT_FALSE(board.last.outputs_on);
}

TEST(DirectForce, OfAProgramThatNeverSendsOutputsGoOffToo) {
  Armed board;
  for (std::uint32_t i = 0; i < board.limits.direct_lost_ticks; ++i) ASSERT_TRUE(board.step().outputs_on);
  EXPECT_FALSE(board.step().outputs_on);
}

TEST(DirectForce, ThatIsImplausibleIsAFault) {
  Armed board;
  board.hold({0.0f, 2.0f * board.limits.force_fault_N, 0.0f}, 1);
  EXPECT_FALSE(board.last.outputs_on);
  EXPECT_EQ(board.state.faults, bit(Fault::force_implausible));
}

// The board but for its hardware, and a program at the other end of its link.
class DirectDevice : public ::testing::Test {
 protected:
  void ticks(std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      output_ = servo_->isr_tick(timing_, sensors_);
      ++timing_.tick;
      endpoint_->run();
      host_.pump();
    }
  }
  palpate_Command_Response_1_0 command(std::uint8_t action, std::uint32_t token = 0) {
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    host_.send(request);
    ticks(2);
    const auto responses = host_.take<palpate_Command_Response_1_0>();
    EXPECT_EQ(responses.size(), 1u);
    return responses.empty() ? palpate_Command_Response_1_0{} : responses.back();
  }
  void arm() {
    ticks(limits_.boot_ticks);
    const auto challenge = command(palpate_Command_Request_1_0_ARM_DIRECT);
    const auto confirmed = command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token);
    ASSERT_EQ(confirmed.mode, palpate_BoardStatus_1_0_MODE_DIRECT);
  }
  void ask_for_states(std::uint8_t ticks_between) {
    host_.send(palpate_TraceRequest_1_0{
        .first_tick = 0, .count = 0, .form = palpate_TraceRequest_1_0_FORM_DEVICE, .ticks = ticks_between});
  }
  void send(const Vec3f& force_N) {
    host_.send(palpate_DirectForce_1_0{.force_N = {force_N.x, force_N.y, force_N.z}});
  }

  const Limits limits_{};
  Mailbox mailbox_{};
  std::unique_ptr<LinkBuffers> link_ = std::make_unique<LinkBuffers>();
  std::unique_ptr<Renderer> renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
  std::unique_ptr<Servo> servo_ = std::make_unique<Servo>(kDevice, limits_, 1u, *renderer_, mailbox_);
  std::unique_ptr<Endpoint> endpoint_ = std::make_unique<Endpoint>(
      *renderer_, *servo_, limits_, mailbox_, *link_, BoardIdentity{"memory", "1.2.3", {1}}, 25'000'000);
  test::HostPeer host_{*link_};
  ServoTiming timing_{};
  ServoSensors sensors_{};
  ServoOutput output_{};
};

TEST_F(DirectDevice, TheHandFeelsTheForceThatWasSent) {
  arm();
  const Vec3f force_N{0.5f, -0.25f, 1.0f};
  for (std::uint32_t i = 0; i < limits_.soft_start_ticks + 10; ++i) {
    send(force_N);
    ticks(1);
  }
  EXPECT_TRUE(output_.outputs_on);
  EXPECT_EQ(output_.force_N, -force_N);  // of the tip on the body
  const device::Pose pose = device::evaluate(kDevice, {});
  const CurrentLimit expected = reaction_currents(kDevice, pose, -force_N, limits_.motor_current_A);
  EXPECT_EQ(output_.setpoint_A, expected.setpoint_A);
}

TEST_F(DirectDevice, SaysWhereItIsHowFastAndWhatItRenders) {
  arm();
  ask_for_states(1);
  ticks(2);
  (void)host_.take<palpate_DeviceState_1_0>();
  // A joint at a constant rate: 3 counts a tick.
  constexpr std::int32_t kCountsPerTick = 3;
  const Vec3f force_N{0.0f, 0.5f, 0.0f};
  for (int i = 0; i < 200; ++i) {
    sensors_.count[0] += kCountsPerTick;
    send(force_N);
    ticks(1);
  }
  const auto states = host_.take<palpate_DeviceState_1_0>();
  ASSERT_EQ(states.size(), 200u);
  for (std::size_t i = 1; i < states.size(); ++i) EXPECT_EQ(states[i].tick, states[i - 1].tick + 1);
  const auto& last = states.back();
  const auto& before = states[states.size() - 2];
  EXPECT_EQ(last.mode, palpate_BoardStatus_1_0_MODE_DIRECT);
  EXPECT_NE(last.flags & palpate_ServoSample_1_0_FLAG_DIRECT, 0);
  EXPECT_EQ(last.faults, 0);
  // 3 counts a tick on some 0.2 m are 0.1 m/s; the estimate has settled after 200 counts to float rounding of
  // the difference of positions, and the path's curvature over a tick is 1e-4 of it.
  constexpr float kTolerance_m_s = 5e-4f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(last.velocity_m_s[axis], (last.tip_m[axis] - before.tip_m[axis]) * 1000.0f, kTolerance_m_s);
    EXPECT_EQ(last.force_N[axis], force_N[axis]);
  }
  EXPECT_GT(std::fabs(last.velocity_m_s[0]) + std::fabs(last.velocity_m_s[1]), 0.05f);
}

TEST_F(DirectDevice, SendsStatesAsOftenAsItIsAskedAndTracesAgainAfterwards) {
  ask_for_states(8);
  ticks(2);
  (void)host_.take<palpate_DeviceState_1_0>();
  (void)host_.take<palpate_ServoTrace_1_0>();
  ticks(80);
  EXPECT_EQ(host_.take<palpate_DeviceState_1_0>().size(), 10u);
  EXPECT_TRUE(host_.take<palpate_ServoTrace_1_0>().empty());
  const std::uint32_t switched_tick = timing_.tick;
  host_.send(palpate_TraceRequest_1_0{
      .first_tick = 0, .count = 0, .form = palpate_TraceRequest_1_0_FORM_FULL, .ticks = 4});
  ticks(41);
  EXPECT_TRUE(host_.take<palpate_DeviceState_1_0>().empty());
  const auto traces = host_.take<palpate_ServoTrace_1_0>();
  ASSERT_GE(traces.size(), 10u);
  EXPECT_GE(traces.front().first_tick + 1, switched_tick);  // no backlog
}

TEST_F(DirectDevice, RefusesToSendStatesAgain) {
  const auto refused = endpoint_->counters().frames_refused;
  host_.send(palpate_TraceRequest_1_0{
      .first_tick = 0, .count = 1, .form = palpate_TraceRequest_1_0_FORM_DEVICE, .ticks = 1});
  ticks(1);
  EXPECT_EQ(endpoint_->counters().frames_refused, refused + 1);
}

TEST_F(DirectDevice, ObeysTheProgramThatArmedIt) {
  arm();
  ticks(limits_.soft_start_ticks + 1);
  const auto refused = endpoint_->counters().frames_refused;
  constexpr std::uint16_t kOther = 11;
  std::vector<std::uint8_t> bytes(128);
  const auto payload = test::HostPeer::payload(palpate_DirectForce_1_0{.force_N = {1.0f, 0.0f, 0.0f}});
  bytes.resize(wire::encode_frame({.source = kOther,
                                   .destination = wire::kBroadcast,
                                   .specifier = wire::MessageTraits<palpate_DirectForce_1_0>::kSpecifier,
                                   .transfer_id = 1},
                                  payload, bytes));
  host_.send_bytes(bytes);
  ticks(2);
  EXPECT_EQ(output_.force_N, Vec3f{});
  EXPECT_EQ(endpoint_->counters().frames_refused, refused + 1);
}

// Neither what was sent before, nor what was a fault, comes back when the outputs do.
TEST_F(DirectDevice, ForcesOfBeforeAreForgotten) {
  arm();
  ticks(limits_.soft_start_ticks + 1);
  send({0.0f, 0.0f, 2.0f * limits_.force_fault_N});
  ticks(2);
  ASSERT_FALSE(output_.outputs_on);
  ASSERT_EQ(output_.mode, Mode::fault);
  send({0.0f, 0.0f, 2.0f * limits_.force_fault_N});  // in fault
  EXPECT_EQ(command(palpate_Command_Request_1_0_CLEAR_FAULT).status, 0);
  send({0.0f, 0.0f, 5.0f});  // in idle
  ticks(1);
  const auto challenge = command(palpate_Command_Request_1_0_ARM_DIRECT);
  ASSERT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token).status, 0);
  for (std::uint32_t i = 0; i < 2 * limits_.soft_start_ticks; ++i) {
    ticks(1);
    ASSERT_TRUE(output_.outputs_on) << i;
    ASSERT_EQ(output_.force_N, Vec3f{}) << i;
  }
}

// A board that has been on for a month, whose program comes back to it.
TEST_F(DirectDevice, SendsStatesAtAnyTick) {
  for (const std::uint32_t tick : {0x80000010u, 0xfffffff0u}) {
    timing_.tick = tick;
    ticks(2);
    ask_for_states(1);
    ticks(2);
    (void)host_.take<palpate_DeviceState_1_0>();
    ticks(40);
    const auto states = host_.take<palpate_DeviceState_1_0>();
    ASSERT_EQ(states.size(), 40u) << tick;
    EXPECT_EQ(states.back().tick, timing_.tick - 1);
    host_.send(palpate_TraceRequest_1_0{
        .first_tick = 0, .count = 0, .form = palpate_TraceRequest_1_0_FORM_FULL, .ticks = 4});
    ticks(2);
    (void)host_.take<palpate_DeviceState_1_0>();
    ticks(40);
    EXPECT_TRUE(host_.take<palpate_DeviceState_1_0>().empty());
  }
}

TEST_F(DirectDevice, RefusesNumbersThatAreNone) {
  arm();
  ticks(limits_.soft_start_ticks + 1);
  const auto refused = endpoint_->counters().frames_refused;
  send({NAN, 0.0f, 0.0f});
  send({0.0f, INFINITY, 0.0f});
  ticks(2);
  EXPECT_EQ(endpoint_->counters().frames_refused, refused + 2);
  EXPECT_TRUE(output_.outputs_on);
  EXPECT_EQ(output_.force_N, Vec3f{});
}

TEST_F(DirectDevice, ForgetsTheModelWhenItIsArmed) {
  ticks(limits_.boot_ticks);
  host_.send(test::square_model(1, timing_.tick - 1, device::evaluate(kDevice, {}).tip_m));
  ticks(30);
  ASSERT_NE(renderer_->model_sequence(), 0u);
  arm();
  EXPECT_EQ(renderer_->model_sequence(), 0u);
}

}  // namespace
}  // namespace palpate::firmware
