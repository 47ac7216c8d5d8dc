#include "firmware/core/supervisor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kSeed = 0x12345678u;
// Rounding of the limited force: a few operations on numbers up to 10 N.
constexpr float kForceRounding_N = 4e-6f;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A supervisor and its inputs, tick by tick.
struct Board {
  Limits limits{};
  SupervisorState state{};
  SupervisorInputs in{};
  Decision last{};

  Decision step() {
    last = supervise(state, in, limits, kSeed);
    state = last.state;
    in.tick += in.elapsed_ticks;
    in.command = {};
    return last;
  }
  Decision command(Action action, std::uint32_t token = 0) {
    in.command = {action, token};
    return step();
  }
  void steps(std::uint32_t ticks) {
    for (std::uint32_t i = 0; i < ticks; ++i) step();
  }
  void boot() { steps(limits.boot_ticks); }
  std::uint32_t challenge() { return command(Action::arm_request).outcome.token; }
  void arm() {
    boot();
    command(Action::arm_confirm, challenge());
  }
  // A model that is fresh and asks for this force.
  void ask(const Vec3f& force_N) {
    in.force_N = force_N;
    in.model_sequence = 1;
    in.model_valid_ticks = 1000;
  }
};

TEST(Supervisor, BootsIntoIdleWithOutputsOff) {
  Board board;
  for (std::uint32_t i = 1; i < board.limits.boot_ticks; ++i) {
    EXPECT_EQ(board.step().state.mode, Mode::boot);
    EXPECT_FALSE(board.last.outputs_on);
  }
  EXPECT_EQ(board.step().state.mode, Mode::idle);
  EXPECT_FALSE(board.last.outputs_on);
}

TEST(Supervisor, AnAgeThatHasReachedItsEndStaysThere) {
  Board board;
  board.boot();
  board.state.mode_age_ticks = UINT32_MAX - 1;
  board.step();
  EXPECT_EQ(board.state.mode_age_ticks, UINT32_MAX);
  board.in.elapsed_ticks = 5;
  board.step();
  EXPECT_EQ(board.state.mode_age_ticks, UINT32_MAX);
}

TEST(Supervisor, BootAcceptsOnlyStopAndDisarm) {
  for (const Action action : {Action::arm_request, Action::arm_confirm, Action::calibrate}) {
    Board board;
    EXPECT_EQ(board.command(action, 1).outcome.status, Status::command_refused);
    EXPECT_EQ(board.state.mode, Mode::boot);
  }
  Board board;
  EXPECT_EQ(board.command(Action::disarm).outcome.status, Status::ok);
  EXPECT_EQ(board.command(Action::stop).state.mode, Mode::fault);
}

// ------------------------------------------------------------------------------------------------ arming

TEST(Arming, TakesTwoSteps) {
  Board board;
  board.boot();
  const std::uint32_t token = board.challenge();
  EXPECT_NE(token, 0u);
  EXPECT_FALSE(board.last.outputs_on);
  EXPECT_EQ(board.command(Action::arm_confirm, token).outcome.status, Status::ok);
  EXPECT_TRUE(board.last.outputs_on);
  EXPECT_EQ(board.state.mode, Mode::render);
  EXPECT_EQ(board.command(Action::disarm).state.mode, Mode::idle);
  EXPECT_FALSE(board.last.outputs_on);
}

TEST(Arming, WrongTokenClosesTheChallenge) {
  Board board;
  board.boot();
  const std::uint32_t token = board.challenge();
  EXPECT_EQ(board.command(Action::arm_confirm, token + 1).outcome.status, Status::command_token_wrong);
  EXPECT_EQ(board.command(Action::arm_confirm, token).outcome.status, Status::command_token_wrong);
  EXPECT_FALSE(board.last.outputs_on);
}

// The token is in each status, which everybody reads.
TEST(Arming, OnlyWhoAskedMayConfirm) {
  Board board;
  board.boot();
  board.in.command_node = 10;
  const std::uint32_t token = board.challenge();
  board.in.command_node = 11;
  EXPECT_EQ(board.command(Action::arm_confirm, token).outcome.status, Status::command_refused);
  EXPECT_FALSE(board.last.outputs_on);
  // Nor can it close another's challenge with a wrong one.
  EXPECT_EQ(board.command(Action::arm_confirm, token + 1).outcome.status, Status::command_refused);
  board.in.command_node = 10;
  EXPECT_EQ(board.command(Action::arm_confirm, token).outcome.status, Status::ok);
  EXPECT_TRUE(board.last.outputs_on);
}

TEST(Arming, WithoutChallengeZeroIsNoToken) {
  Board board;
  board.boot();
  EXPECT_EQ(board.command(Action::arm_confirm, 0).outcome.status, Status::command_token_wrong);
  EXPECT_FALSE(board.last.outputs_on);
}

TEST(Arming, WindowIsExact) {
  for (const std::uint32_t late : {0u, 1u}) {
    Board board;
    board.boot();
    const std::uint32_t token = board.challenge();
    board.steps(board.limits.arming_window_ticks - 1 + late);
    board.command(Action::arm_confirm, token);
    EXPECT_EQ(board.last.outputs_on, late == 0);
  }
}

TEST(Arming, WindowCountsLostTicks) {
  Board board;
  board.boot();
  const std::uint32_t token = board.challenge();
  board.in.elapsed_ticks = board.limits.arming_window_ticks + 1;
  EXPECT_EQ(board.command(Action::arm_confirm, token).outcome.status, Status::command_token_wrong);
  EXPECT_FALSE(board.last.outputs_on);
}

TEST(Arming, ANewChallengeReplacesTheOld) {
  Board board;
  board.boot();
  const std::uint32_t first = board.challenge();
  const std::uint32_t second = board.challenge();
  EXPECT_NE(first, second);
  EXPECT_FALSE(board.command(Action::arm_confirm, first).outputs_on);
}

TEST(Arming, TokensAreNeverZeroAndDependOnTheBoard) {
  Board board;
  board.boot();
  for (std::uint32_t tick = 0; tick < 100'000; ++tick) {
    board.in.tick = tick * 977u;
    ASSERT_NE(supervise(
                  board.state,
                  [&] {
                    auto in = board.in;
                    in.command = {Action::arm_request, 0};
                    return in;
                  }(),
                  board.limits, kSeed)
                  .outcome.token,
              0u);
  }
  // tick == seed mixes to zero, and must not.
  board.in.tick = kSeed;
  EXPECT_NE(board.challenge(), 0u);
}

TEST(Arming, FallsWithDisarmAndFault) {
  Board board;
  board.boot();
  std::uint32_t token = board.challenge();
  board.command(Action::disarm);
  EXPECT_FALSE(board.command(Action::arm_confirm, token).outputs_on);
  token = board.challenge();
  board.command(Action::stop);
  board.command(Action::clear_fault);
  EXPECT_FALSE(board.command(Action::arm_confirm, token).outputs_on);
}

// ------------------------------------------------------------------------------------------------ faults

struct Condition {
  std::string name;
  FaultSet faults;
  bool only_while_rendering;
  std::function<void(Board&)> set;
};

std::vector<Condition> conditions() {
  return {
      {"emergency stop", bit(Fault::emergency_stop), false,
       [](Board& b) { b.in.emergency_stop_open = true; }},
      {"stop command", bit(Fault::stop_command), false,
       [](Board& b) {
         b.in.command = {Action::stop, 0};
       }},
      {"NaN tip", bit(Fault::not_a_number), false, [](Board& b) { b.in.tip_m.y = kNan; }},
      {"NaN force", bit(Fault::not_a_number), false, [](Board& b) { b.in.force_N.z = kNan; }},
      {"infinite force", bit(Fault::not_a_number) | bit(Fault::force_implausible), false,
       [](Board& b) { b.in.force_N.x = kInfinity; }},
      {"NaN current", bit(Fault::not_a_number), false, [](Board& b) { b.in.measured_current_A[1] = kNan; }},
      {"NaN joint step", bit(Fault::not_a_number), false, [](Board& b) { b.in.joint_step_rad = kNan; }},
      {"NaN speed", bit(Fault::not_a_number), false, [](Board& b) { b.in.tip_speed_m_s = kNan; }},
      {"NaN step of the tip", bit(Fault::not_a_number), false, [](Board& b) { b.in.tip_step_m.x = kNan; }},
      {"NaN velocity", bit(Fault::not_a_number), false, [](Board& b) { b.in.tip_velocity_m_s.z = kNan; }},
      {"NaN correction", bit(Fault::not_a_number), false, [](Board& b) { b.in.correction_J = kNan; }},
      {"NaN force of a program", bit(Fault::not_a_number), false,
       [](Board& b) { b.in.direct_force_N.y = kNan; }},
      {"encoder jump", bit(Fault::encoder_jump), false,
       [](Board& b) { b.in.joint_step_rad = std::nextafter(b.limits.joint_step_rad, 1.0f); }},
      {"over-current", bit(Fault::over_current), false,
       [](Board& b) {
         b.in.measured_current_A[2] = -1.01f * b.limits.over_current_ratio * b.limits.motor_current_A[2];
         b.limits.over_current_ticks = 1;
       }},
      {"motor heat", bit(Fault::motor_heat), false,
       [](Board& b) { b.in.hottest_motor = std::nextafter(b.limits.heat_fault, 2.0f); }},
      {"unknown motor heat", bit(Fault::motor_heat), false, [](Board& b) { b.in.hottest_motor = kNan; }},
      {"supply low", bit(Fault::supply_low), false, [](Board& b) { b.in.supply_low = true; }},
      {"over-speed", bit(Fault::over_speed), true,
       [](Board& b) { b.in.tip_speed_m_s = std::nextafter(b.limits.tip_speed_m_s, 10.0f); }},
      {"outside workspace", bit(Fault::outside_workspace), true,
       [](Board& b) { b.in.inside_workspace = false; }},
      {"implausible force", bit(Fault::force_implausible), true,
       [](Board& b) {
         b.in.force_N = {0.0f, 1.01f * b.limits.force_fault_N, 0.0f};
       }},
      {"overflowing force", bit(Fault::force_implausible), true,
       [](Board& b) {
         b.in.force_N = {0.0f, 3e38f, 3e38f};
       }},
      {"missed deadlines", bit(Fault::deadline_missed), true, [](Board& b) { b.in.missed_deadlines = 6; }},
  };
}

TEST(Faults, EveryConditionSwitchesOffWithinItsTick) {
  for (const Condition& condition : conditions()) {
    SCOPED_TRACE(condition.name);
    Board board;
    board.arm();
    board.ask({1.0f, 0.0f, 0.0f});
    board.steps(200);
    ASSERT_TRUE(board.last.outputs_on);
    condition.set(board);
    board.step();
    EXPECT_FALSE(board.last.outputs_on);
    EXPECT_EQ(board.state.mode, Mode::fault);
    EXPECT_EQ(board.state.faults, condition.faults);
    EXPECT_EQ(board.state.force_N, Vec3f{});
  }
}

TEST(Faults, StayLatchedUntilTheyAreCleared) {
  for (const Condition& condition : conditions()) {
    SCOPED_TRACE(condition.name);
    Board board;
    board.arm();
    condition.set(board);
    board.step();
    // The condition is gone at once; the fault is not.
    const Limits limits = board.limits;
    board.in = {.tick = board.in.tick};
    board.steps(2000);
    EXPECT_EQ(board.state.mode, Mode::fault);
    for (const Action action :
         {Action::disarm, Action::arm_request, Action::arm_confirm, Action::calibrate}) {
      board.command(action, board.state.token);
      EXPECT_EQ(board.state.mode, Mode::fault);
      EXPECT_FALSE(board.last.outputs_on);
    }
    board.limits = limits;
    EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::ok);
    EXPECT_EQ(board.state.mode, Mode::idle);
    EXPECT_EQ(board.state.faults, 0);
    EXPECT_FALSE(board.last.outputs_on);
  }
}

TEST(Faults, OfRenderingAreNoneWhileOutputsAreOffButRefuseArming) {
  for (const Condition& condition : conditions()) {
    if (!condition.only_while_rendering) continue;
    SCOPED_TRACE(condition.name);
    Board board;
    board.boot();
    condition.set(board);
    EXPECT_EQ(board.step().state.mode, Mode::idle);
    EXPECT_EQ(board.command(Action::arm_request).outcome.status, Status::command_refused);
    EXPECT_EQ(board.state.mode, Mode::idle);
  }
}

TEST(Faults, OfTheDeviceLatchInIdleToo) {
  for (const Condition& condition : conditions()) {
    if (condition.only_while_rendering) continue;
    SCOPED_TRACE(condition.name);
    Board board;
    board.boot();
    condition.set(board);
    EXPECT_EQ(board.step().state.mode, Mode::fault);
  }
}

TEST(Faults, ThatShowAfterTheDecisionAddUpToo) {
  Board board;
  board.arm();
  board.ask({1.0f, 0.0f, 0.0f});
  board.steps(200);
  const Decision once = trip(board.last, Fault::not_a_number);
  EXPECT_FALSE(once.outputs_on);
  EXPECT_FALSE(once.force_limited);
  EXPECT_EQ(once.state.mode, Mode::fault);
  EXPECT_EQ(once.state.force_N, Vec3f{});
  EXPECT_EQ(once.state.mode_age_ticks, 0u);
  Decision later = once;
  later.state.mode_age_ticks = 7;
  later = trip(later, Fault::over_current);
  EXPECT_EQ(later.state.faults, bit(Fault::not_a_number) | bit(Fault::over_current));
  EXPECT_EQ(later.state.mode_age_ticks, 7u);  // in the mode it was in already
}

TEST(Faults, AddUp) {
  Board board;
  board.arm();
  board.in.emergency_stop_open = true;
  board.step();
  board.command(Action::stop);
  EXPECT_EQ(board.state.faults, bit(Fault::emergency_stop) | bit(Fault::stop_command));
}

TEST(Faults, CannotBeClearedWhileTheyLast) {
  Board board;
  board.boot();
  board.in.emergency_stop_open = true;
  board.step();
  EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::command_refused);
  EXPECT_EQ(board.state.mode, Mode::fault);
  board.in.emergency_stop_open = false;
  EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::ok);
}

TEST(Faults, AnEncoderJumpAsksForACalibration) {
  Board board;
  board.boot();
  board.in.joint_step_rad = 1.0f;
  board.step();
  board.in.joint_step_rad = 0.0f;
  board.command(Action::clear_fault);
  EXPECT_EQ(board.command(Action::arm_request).outcome.status, Status::command_refused);
  board.command(Action::calibrate);
  board.steps(board.limits.calibration_ticks);
  EXPECT_EQ(board.command(Action::arm_request).outcome.status, Status::ok);
}

TEST(Faults, OverCurrentMustLast) {
  Board board;
  board.arm();
  const float much_A = 1.1f * board.limits.over_current_ratio * board.limits.motor_current_A[0];
  for (int i = 0; i < 20; ++i) {
    board.in.measured_current_A[0] = much_A;
    board.steps(board.limits.over_current_ticks - 1);
    board.in.measured_current_A[0] = 0.0f;
    board.step();
    ASSERT_TRUE(board.last.outputs_on);
  }
  board.in.measured_current_A[0] = much_A;
  board.steps(board.limits.over_current_ticks);
  EXPECT_EQ(board.state.faults, bit(Fault::over_current));
}

TEST(Faults, CurrentTrackingMustLastWhileOutputsAreOn) {
  Board board;
  board.in.current_error_A = 100.0f;
  board.boot();
  board.steps(1000);  // off: a motor that a hand turns feeds its amplifier
  ASSERT_EQ(board.state.faults, 0);
  board.command(Action::arm_confirm, board.challenge());
  ASSERT_TRUE(board.last.outputs_on);
  for (int i = 0; i < 20; ++i) {
    board.in.current_error_A = 100.0f;
    board.steps(board.limits.current_tracking_ticks - 1);
    board.in.current_error_A = board.limits.current_tracking_A;
    board.step();
    ASSERT_TRUE(board.last.outputs_on);
  }
  board.in.current_error_A = std::nextafter(board.limits.current_tracking_A, 2.0f);
  board.steps(board.limits.current_tracking_ticks);
  EXPECT_EQ(board.state.faults, bit(Fault::current_tracking));
  EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::ok);
}

TEST(Faults, CurrentTrackingCountsLostTicks) {
  Board board;
  board.arm();
  board.in.current_error_A = 2.0f;
  board.in.elapsed_ticks = board.limits.current_tracking_ticks;
  EXPECT_EQ(board.step().state.faults, bit(Fault::current_tracking));
}

TEST(Faults, SingleMissedDeadlinesAreForgiven) {
  Board board;
  board.arm();
  for (int i = 0; i < 20; ++i) {
    board.in.missed_deadlines = 1;
    board.step();
    board.in.missed_deadlines = 0;
    board.steps(board.limits.missed_deadline_weight);
    ASSERT_TRUE(board.last.outputs_on) << i;
  }
  for (int i = 0; i < 6; ++i) {
    board.in.missed_deadlines = 1;
    board.step();
  }
  EXPECT_EQ(board.state.faults, bit(Fault::deadline_missed));
}

TEST(Faults, MissedDeadlinesDoNotWrap) {
  Board board;
  board.arm();
  board.in.missed_deadlines = 0xFFFFFFFFu;
  board.in.elapsed_ticks = 0xFFFFFFFFu;
  board.step();
  EXPECT_EQ(board.state.faults, bit(Fault::deadline_missed));
}

TEST(Faults, TripSwitchesOff) {
  Board board;
  board.arm();
  board.ask({1.0f, 0.0f, 0.0f});
  board.steps(200);
  const Decision tripped = trip(board.last, Fault::not_a_number);
  EXPECT_FALSE(tripped.outputs_on);
  EXPECT_EQ(tripped.state.mode, Mode::fault);
  EXPECT_EQ(tripped.state.faults, bit(Fault::not_a_number));
  EXPECT_EQ(tripped.state.force_N, Vec3f{});
}

// ------------------------------------------------------------------------------------------------
// calibration

TEST(Calibration, SetsTheZeroAfterRest) {
  Board board;
  board.boot();
  EXPECT_TRUE(board.command(Action::calibrate).calibration_begins);
  EXPECT_EQ(board.state.mode, Mode::calibrate);
  std::uint32_t ticks = 0;
  while (!board.step().calibration_ends) {
    EXPECT_FALSE(board.last.outputs_on);
    ASSERT_LT(++ticks, board.limits.calibration_ticks);
  }
  EXPECT_EQ(board.state.mode, Mode::idle);
}

TEST(Calibration, MotionKeepsTheOldZero) {
  Board board;
  board.boot();
  board.in.at_rest = false;
  EXPECT_EQ(board.command(Action::calibrate).outcome.status, Status::command_refused);
  board.in.at_rest = true;
  board.command(Action::calibrate);
  board.steps(board.limits.calibration_ticks - 1);
  board.in.at_rest = false;
  board.step();
  EXPECT_FALSE(board.last.calibration_ends);
  EXPECT_EQ(board.state.mode, Mode::idle);
}

TEST(Calibration, OnlyFromIdle) {
  Board board;
  board.arm();
  EXPECT_EQ(board.command(Action::calibrate).outcome.status, Status::command_refused);
  EXPECT_EQ(board.state.mode, Mode::render);
}

TEST(Calibration, CuresAPositionOutsideTheWorkspace) {
  Board board;
  board.boot();
  board.in.inside_workspace = false;
  EXPECT_EQ(board.command(Action::calibrate).outcome.status, Status::ok);
}

TEST(Calibration, IsRefusedWithTheEmergencyStopOpen) {
  Board board;
  board.boot();
  board.in.emergency_stop_open = true;
  const Decision decision = board.command(Action::calibrate);
  EXPECT_EQ(decision.outcome.status, Status::command_refused);
  EXPECT_FALSE(decision.calibration_begins);
}

// ------------------------------------------------------------------------------------------------ force

TEST(Force, SoftStartRampsTheModelsForce) {
  Board board;
  board.ask({0.0f, 0.0f, 2.0f});
  board.arm();
  EXPECT_EQ(board.state.force_N, Vec3f{});
  for (std::uint32_t i = 1; i <= board.limits.soft_start_ticks; ++i) {
    board.step();
    const float expected_N = 2.0f * static_cast<float>(i) / static_cast<float>(board.limits.soft_start_ticks);
    ASSERT_NEAR(board.state.force_N.z, expected_N, kForceRounding_N);
    ASSERT_EQ(board.last.force_limited, i < board.limits.soft_start_ticks);
  }
}

TEST(Force, UnlimitedIsTheModelsToTheBit) {
  Board board;
  board.ask({0.1f, -0.7f, 3.3f});
  board.arm();
  board.steps(300);
  EXPECT_EQ(board.state.force_N, (Vec3f{0.1f, -0.7f, 3.3f}));
  EXPECT_FALSE(board.last.force_limited);
}

TEST(Force, PeakKeepsItsDirection) {
  Board board;
  board.ask({0.0f, 30.0f, 40.0f});
  board.arm();
  board.steps(300);
  EXPECT_NEAR(norm(board.state.force_N), board.limits.peak_force_N, kForceRounding_N);
  EXPECT_NEAR(board.state.force_N.y, 0.6f * board.limits.peak_force_N, kForceRounding_N);
  EXPECT_TRUE(board.last.force_limited);
}

TEST(Force, ChangesByALimitedStep) {
  std::mt19937 random(3);
  std::normal_distribution<float> component(0.0f, 8.0f);
  Board board;
  board.arm();
  board.ask({});
  board.steps(200);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3f before_N = board.state.force_N;
    board.in.force_N = {component(random), component(random), component(random)};
    board.step();
    ASSERT_TRUE(board.last.outputs_on);
    ASSERT_LE(norm(board.state.force_N - before_N), board.limits.force_step_N + kForceRounding_N);
    ASSERT_LE(norm(board.state.force_N), board.limits.peak_force_N + kForceRounding_N);
  }
}

TEST(Force, WithoutAModelIsZeroAndNoFault) {
  Board board;
  board.arm();
  board.in.force_N = {1.0f, 0.0f, 0.0f};  // of no model: must not be rendered
  board.steps(300);
  EXPECT_TRUE(board.last.outputs_on);
  EXPECT_EQ(board.state.force_N, Vec3f{});
}

TEST(Force, AStaleModelFadesToZeroAndIsNoFault) {
  Board board;
  board.ask({0.0f, 0.0f, 2.0f});
  board.arm();
  board.steps(200);
  board.in.model_valid_ticks = 150;
  float previous_N = 2.0f;
  for (std::uint32_t age = 0; age <= 150 + board.limits.model_fade_ticks; ++age) {
    board.in.model_age_ticks = age;
    board.step();
    ASSERT_TRUE(board.last.outputs_on);
    if (age <= 150) {
      ASSERT_EQ(board.state.force_N.z, 2.0f);
    } else {
      ASSERT_LT(board.state.force_N.z, previous_N);
    }
    previous_N = board.state.force_N.z;
  }
  EXPECT_EQ(previous_N, 0.0f);
}

TEST(Force, NoHorizonIsBeyondTheBoards) {
  Board board;
  board.ask({0.0f, 0.0f, 2.0f});
  board.in.model_valid_ticks = 60'000;
  board.arm();
  board.in.model_age_ticks = board.limits.model_horizon_ticks + board.limits.model_fade_ticks;
  board.steps(300);
  EXPECT_EQ(board.state.force_N, Vec3f{});
}

// ------------------------------------------------------------------------------------------------ currents

TEST(Currents, ShrinkTogether) {
  const Limits limits{.motor_current_A = {1.0f, 2.0f, 4.0f}};
  const CurrentLimit result = limit_currents({-2.0f, 1.0f, 1.0f}, limits.motor_current_A);
  EXPECT_TRUE(result.limited);
  EXPECT_FLOAT_EQ(result.setpoint_A[0], -1.0f);
  EXPECT_FLOAT_EQ(result.setpoint_A[1], 0.5f);
  const CurrentLimit free = limit_currents({1.0f, -2.0f, 4.0f}, limits.motor_current_A);
  EXPECT_FALSE(free.limited);
  EXPECT_EQ(free.setpoint_A, (std::array<float, 3>{1.0f, -2.0f, 4.0f}));
}

TEST(Currents, NotFiniteIsZeroAndSaysSo) {
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    for (std::size_t i = 0; i < 3; ++i) {
      std::array<float, 3> wanted_A{0.1f, 0.1f, 0.1f};
      wanted_A[i] = bad;
      const CurrentLimit result = limit_currents(wanted_A, kDefaultLimits.motor_current_A);
      EXPECT_FALSE(result.finite);
      EXPECT_EQ(result.setpoint_A, (std::array<float, 3>{}));
    }
  }
}

TEST(Currents, SmallOnesAreLeftAlone) {
  const std::array<float, 3> wanted_A{0.1f, -0.2f, 0.0f};
  const CurrentLimit result = limit_currents(wanted_A, kDefaultLimits.motor_current_A);
  EXPECT_FALSE(result.limited);
  EXPECT_EQ(result.setpoint_A, wanted_A);
}

// Whichever motor is furthest over its limit decides.
TEST(Currents, TheFactorIsThatOfTheMotorThatIsFurthestOver) {
  const std::array<float, 3> largest_A{2.0f, 1.0f, 4.0f};
  for (const auto& wanted_A :
       {std::array<float, 3>{4.0f, 1.5f, 5.0f}, {2.5f, 2.0f, 5.0f}, {3.0f, 1.5f, -8.0f}}) {
    const CurrentLimit result = limit_currents(wanted_A, largest_A);
    EXPECT_TRUE(result.limited);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_FLOAT_EQ(result.setpoint_A[i], 0.5f * wanted_A[i]);
  }
}

}  // namespace
}  // namespace palpate::firmware
