// Every limit of the supervisor exactly at its end, and what a state must have forgotten: what a wrong
// comparison or a missing statement would change by a single tick or bit (`palpate bench mutants`).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "firmware/core/supervisor.hpp"

namespace palpate::firmware {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Board {
  Limits limits{};
  SupervisorState state{};
  SupervisorInputs in{};
  Decision last{};

  Decision step(std::uint32_t elapsed_ticks = 1) {
    in.elapsed_ticks = elapsed_ticks;
    last = supervise(state, in, limits, 1);
    state = last.state;
    in.tick += elapsed_ticks;
    in.command = {};
    return last;
  }
  void steps(std::uint32_t ticks) {
    for (std::uint32_t i = 0; i < ticks; ++i) step();
  }
  Decision command(Action action, std::uint32_t token = 0) {
    in.command = {action, token};
    return step();
  }
  void arm(Action action = Action::arm_request) {
    if (state.mode == Mode::boot) steps(limits.boot_ticks);
    command(action);
    command(Action::arm_confirm, state.token);
    ASSERT_TRUE(last.outputs_on);
  }
  // Renders this force, beyond its soft start.
  void press(const Vec3f& force_N) {
    in.force_N = force_N;
    in.model_sequence = 1;
    in.model_valid_ticks = 1000;
    in.model_age_ticks = 0;
    arm();
    steps(limits.soft_start_ticks + 20);
    ASSERT_EQ(state.force_N, force_N);
  }
};

struct Edge {
  std::string name;
  std::function<void(Board&, bool beyond)> set;
  FaultSet fault;
};

float next(float value, bool beyond) {
  return beyond ? std::nextafter(value, kInfinity) : value;
}

TEST(SupervisorEdges, WhatIsJustAllowedIsNoFault) {
  const std::vector<Edge> edges{
      {"joint step",
       [](Board& b, bool beyond) { b.in.joint_step_rad = next(b.limits.joint_step_rad, beyond); },
       bit(Fault::encoder_jump)},
      {"speed", [](Board& b, bool beyond) { b.in.tip_speed_m_s = next(b.limits.tip_speed_m_s, beyond); },
       bit(Fault::over_speed)},
      {"force", [](Board& b, bool beyond) { b.in.force_N.x = next(b.limits.force_fault_N, beyond); },
       bit(Fault::force_implausible)},
      {"heat", [](Board& b, bool beyond) { b.in.hottest_motor = next(b.limits.heat_fault, beyond); },
       bit(Fault::motor_heat)},
      {"deadlines",
       [](Board& b, bool beyond) {
         b.state.missed_deadline_level = b.limits.missed_deadline_bucket + (beyond ? 2u : 1u);
       },
       bit(Fault::deadline_missed)},
      {"energy",
       [](Board& b, bool beyond) {
         b.limits.energy_leak_W = 0.0f;
         b.state.energy_J = next(b.limits.energy_J, beyond);
       },
       bit(Fault::energy_created)},
      {"tracking",
       [](Board& b, bool beyond) {
         b.state.tracking_ticks = b.limits.current_tracking_ticks - 1;
         b.in.current_error_A = next(b.limits.current_tracking_A, beyond);
       },
       bit(Fault::current_tracking)},
      {"tracking ticks",
       [](Board& b, bool beyond) {
         b.state.tracking_ticks = b.limits.current_tracking_ticks - (beyond ? 1u : 2u);
         b.in.current_error_A = 2.0f;
       },
       bit(Fault::current_tracking)},
      {"over-current ticks",
       [](Board& b, bool beyond) {
         b.state.over_current_ticks = b.limits.over_current_ticks - (beyond ? 1u : 2u);
         b.in.measured_current_A = {-20.0f, 0.0f, 0.0f};
       },
       bit(Fault::over_current)},
  };
  for (std::size_t motor = 0; motor < 3; ++motor) {
    for (const bool beyond : {false, true}) {
      Board board;
      board.arm();
      board.state.over_current_ticks = board.limits.over_current_ticks - 1;
      board.in.measured_current_A[motor] =
          next(board.limits.motor_current_A[motor] * board.limits.over_current_ratio, beyond);
      board.step();
      EXPECT_EQ(board.state.faults, beyond ? bit(Fault::over_current) : 0) << motor;
    }
  }
  for (const Edge& edge : edges) {
    SCOPED_TRACE(edge.name);
    for (const bool beyond : {false, true}) {
      Board board;
      board.arm();
      edge.set(board, beyond);
      board.step();
      EXPECT_EQ(board.state.faults, beyond ? edge.fault : 0);
      EXPECT_EQ(board.last.outputs_on, !beyond);
    }
  }
}

TEST(SupervisorEdges, AllConditionsOfATickAreLatched) {
  Board board;
  board.arm();
  SupervisorInputs& in = board.in;
  in.emergency_stop_open = true;
  in.supply_low = true;
  in.command = {Action::stop, 0};
  in.correction_J = kInfinity;
  in.joint_step_rad = 1.0f;
  in.measured_current_A[2] = 100.0f;
  board.state.over_current_ticks = 100;
  in.hottest_motor = 2.0f;
  in.tip_speed_m_s = 100.0f;
  in.inside_workspace = false;
  in.force_N = {0.0f, 0.0f, 1000.0f};
  in.missed_deadlines = 1000;
  board.state.energy_J = 100.0f;
  in.current_error_A = 100.0f;
  board.state.tracking_ticks = 100;
  board.step();
  // All but link_lost, which is none of an armed board.
  EXPECT_EQ(board.state.faults, ((1u << 14) - 1u) & ~unsigned{bit(Fault::link_lost)});
}

// Reference values of the finalizer of MurmurHash3, computed apart from this project.
TEST(SupervisorEdges, ATokenIsTheMixedTickAndNeverZero) {
  const auto token = [](std::uint32_t tick, std::uint32_t seed) {
    const SupervisorState idle{.mode = Mode::idle};
    return supervise(idle, {.tick = tick, .command = {Action::arm_request, 0}}, kDefaultLimits, seed)
        .state.token;
  };
  EXPECT_EQ(token(1, 0), 0x514e28b7u);
  EXPECT_EQ(token(0, 2), 0x30f4c306u);
  EXPECT_EQ(token(0xffff0000u, 0x0000ffffu), 0x81f16f39u);
  EXPECT_EQ(token(3, 1), 0x30f4c306u);
  EXPECT_EQ(token(77, 77), 1u);  // the mixture of 0 is 0
}

// Token 1 is one like any other; 0 is none.
TEST(SupervisorEdges, ATokenOfOneIsAChallenge) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.step();
  EXPECT_EQ(board.state.token_age_ticks, 0u);  // nothing to grow old
  board.in.tick = 1;                           // the board's seed
  board.in.command_node = 10;
  board.command(Action::arm_request);
  ASSERT_EQ(board.state.token, 1u);
  board.in.command_node = 11;
  EXPECT_EQ(board.command(Action::arm_confirm, 1).outcome.status, Status::command_refused);
  EXPECT_EQ(board.state.token_age_ticks, 1u);
  board.in.command_node = 10;
  EXPECT_EQ(board.command(Action::arm_confirm, 2).outcome.status, Status::command_token_wrong);
  EXPECT_EQ(board.state.token, 0u);
  board.in.command_node = 11;
  EXPECT_EQ(board.command(Action::arm_confirm, 1).outcome.status, Status::command_token_wrong);
  EXPECT_EQ(board.last.outcome.action, Action::arm_confirm);
}

TEST(SupervisorEdges, ANewChallengeHasAWindowOfItsOwn) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.command(Action::arm_request);
  board.steps(900);
  board.command(Action::arm_request);
  EXPECT_EQ(board.state.token_age_ticks, 0u);
  board.steps(900);
  EXPECT_EQ(board.command(Action::arm_confirm, board.state.token).outcome.status, Status::ok);
}

TEST(SupervisorEdges, AConditionRefusesTheCommandOfItsTick) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.in.emergency_stop_open = true;
  EXPECT_EQ(board.command(Action::arm_request).outcome.status, Status::command_refused);
  // In the mode of a fault time goes on while the condition lasts.
  board.steps(7);
  EXPECT_EQ(board.state.mode, Mode::fault);
  EXPECT_EQ(board.state.mode_age_ticks, 7u);
}

TEST(SupervisorEdges, ClearingNothingChangesNothing) {
  Board board;
  EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::ok);
  EXPECT_EQ(board.state.mode, Mode::boot);
  board.arm();
  EXPECT_EQ(board.command(Action::clear_fault).outcome.status, Status::ok);
  EXPECT_EQ(board.state.mode, Mode::render);
}

TEST(SupervisorEdges, ATickWithoutTimeAddsNone) {
  Board board;
  board.steps(5);
  board.step(0);
  EXPECT_EQ(board.state.mode_age_ticks, 5u);
}

// A mode begins with nothing of the one before it.
TEST(SupervisorEdges, AModeRemembersNothingOfTheOneBefore) {
  const SupervisorState full{.mode = Mode::render,
                             .mode_age_ticks = 500,
                             .token = 5,
                             .token_age_ticks = 6,
                             .token_is_direct = true,
                             .token_node = 7,
                             .force_N = {1.0f, 0.0f, 0.0f},
                             .force_was_lost = true,
                             .growth_had_ended = true,
                             .grown_N = 1.0f,
                             .soft_start_ticks = 50,
                             .damping_ticks = 60,
                             .energy_J = 0.1f,
                             .passivity = {.balance_J = -1e-3f, .debt_J = 1e-3f, .damping_N = {1, 0, 0}}};
  const SupervisorInputs disarm{.command = {Action::disarm, 0}};
  EXPECT_EQ(supervise(full, disarm, kDefaultLimits, 1).state, SupervisorState{.mode = Mode::idle});
  const SupervisorInputs stop{.command = {Action::stop, 0}};
  EXPECT_EQ(supervise(full, stop, kDefaultLimits, 1).state,
            (SupervisorState{.mode = Mode::fault, .faults = bit(Fault::stop_command)}));
  const Decision decision{.state = full,
                          .outputs_on = true,
                          .force_limited = true,
                          .calibration_begins = true,
                          .calibration_ends = true,
                          .outcome = {.token = 5}};
  const Decision tripped = trip(decision, Fault::over_current);
  EXPECT_EQ(tripped.state, (SupervisorState{.mode = Mode::fault, .faults = bit(Fault::over_current)}));
  EXPECT_FALSE(tripped.outputs_on || tripped.force_limited || tripped.calibration_begins ||
               tripped.calibration_ends);
  EXPECT_EQ(tripped.outcome.token, 0u);
}

TEST(SupervisorEdges, ACalibrationTakesItsTicks) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.command(Action::calibrate);
  for (std::uint32_t i = 1; i < board.limits.calibration_ticks; ++i) {
    board.step();
    ASSERT_EQ(board.state.mode, Mode::calibrate) << i;
    ASSERT_FALSE(board.last.calibration_begins || board.last.calibration_ends);
  }
  board.step();
  EXPECT_TRUE(board.last.calibration_ends);
  EXPECT_EQ(board.state.mode, Mode::idle);
}

// A fault in the tick in which a calibration would begin or end leaves the zero where it was.
TEST(SupervisorEdges, AFaultEndsACalibrationWithoutAZero) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.command(Action::calibrate);
  board.steps(board.limits.calibration_ticks - 1);
  board.in.supply_low = true;
  board.step();
  EXPECT_FALSE(board.last.calibration_ends);
  EXPECT_EQ(board.state.mode, Mode::fault);
}

TEST(SupervisorEdges, TheBucketOfDeadlinesDrainsByTheTickAndIsFullAtTwice) {
  Board board;
  board.steps(board.limits.boot_ticks);
  board.in.missed_deadlines = 2;
  board.step();
  EXPECT_EQ(board.state.missed_deadline_level, 200u);
  board.in.missed_deadlines = 0;
  board.step(199);
  EXPECT_EQ(board.state.missed_deadline_level, 1u);
  board.step(1);
  EXPECT_EQ(board.state.missed_deadline_level, 0u);
  board.step(1);
  EXPECT_EQ(board.state.missed_deadline_level, 0u);
  board.in.missed_deadlines = 11;
  board.step();
  EXPECT_EQ(board.state.missed_deadline_level, 1000u);
  board.in.missed_deadlines = 0;
  board.step(2000);
  EXPECT_EQ(board.state.missed_deadline_level, 0u);
}

TEST(SupervisorEdges, TheBucketOfEnergyLeaksAndForgetsWhatIsTaken) {
  Board board;
  board.press({0.0f, 0.0f, 2.0f});
  board.in.tip_step_m = {0.0f, 0.0f, -1e-3f};
  board.step();
  EXPECT_FLOAT_EQ(board.state.energy_J, 2e-3f - 0.5e-3f);
  board.in.tip_step_m = {};
  board.step(2);
  EXPECT_FLOAT_EQ(board.state.energy_J, 0.5e-3f);
  board.in.tip_step_m = {0.0f, 0.0f, 1e-3f};
  board.step();
  EXPECT_EQ(board.state.energy_J, 0.0f);
}

// A horizon, fade and window to the tick.
TEST(SupervisorEdges, AModelHoldsToItsHorizonAndHasFadedAtItsEnd) {
  Board board;
  board.limits.force_step_N = 20.0f;  // the fade alone
  board.press({0.0f, 0.0f, 2.0f});
  const auto force_at = [&](std::uint32_t age_ticks) {
    board.in.model_age_ticks = age_ticks;
    const Decision decision = supervise(board.state, board.in, board.limits, 1);
    return decision.state.force_N.z;
  };
  board.in.model_valid_ticks = 300;
  EXPECT_EQ(force_at(300), 2.0f);
  EXPECT_FLOAT_EQ(force_at(301), 2.0f * 199.0f / 200.0f);
  EXPECT_FLOAT_EQ(force_at(400), 1.0f);
  EXPECT_NEAR(force_at(499), 2.0f / 200.0f, 1e-6f);  // of 1, rounded before the product
  EXPECT_EQ(force_at(500), 0.0f);
  EXPECT_EQ(supervise(board.state, board.in, board.limits, 1).state.damping_ticks, 1u);
  board.in.model_age_ticks = 499;
  EXPECT_EQ(supervise(board.state, board.in, board.limits, 1).state.damping_ticks, 0u);
}

TEST(SupervisorEdges, DampingAndSilenceEndToTheTick) {
  Board board;
  board.press({0.0f, 0.0f, 2.0f});
  board.in.model_age_ticks = 5000;
  board.steps(board.limits.damping_ticks);
  EXPECT_EQ(board.state.mode, Mode::render);
  EXPECT_EQ(board.state.damping_ticks, board.limits.damping_ticks);
  board.step();
  EXPECT_EQ(board.state.mode, Mode::suspended);
  // A fresh model brings the force back only from a host that is not silent, and in time.
  const auto resumes = [&](std::uint32_t link_age_ticks, std::uint32_t mode_age_ticks,
                           std::uint32_t age_ticks) {
    SupervisorState state = board.state;
    state.mode_age_ticks = mode_age_ticks;
    SupervisorInputs in = board.in;
    in.elapsed_ticks = 1;
    in.link_age_ticks = link_age_ticks;
    in.model_age_ticks = age_ticks;
    return supervise(state, in, board.limits, 1).state.mode;
  };
  const std::uint32_t silent = board.limits.link_silent_ticks, lost = board.limits.link_lost_ticks;
  EXPECT_EQ(resumes(silent, 0, 1000), Mode::render);
  EXPECT_EQ(resumes(silent + 1, 0, 0), Mode::suspended);
  EXPECT_EQ(resumes(0, 0, 1001), Mode::suspended);
  EXPECT_EQ(resumes(0, lost - 1, 0), Mode::render);
  EXPECT_EQ(resumes(0, lost, 0), Mode::fault);
  EXPECT_EQ(resumes(lost, 0, 0), Mode::suspended);
  EXPECT_EQ(resumes(lost + 1, 0, 0), Mode::fault);
}

TEST(SupervisorEdges, WhatIsLostAndBrokenIsBoth) {
  const SupervisorState state{.mode = Mode::suspended};
  const SupervisorInputs in{.supply_low = true, .link_age_ticks = kDefaultLimits.link_lost_ticks + 1};
  EXPECT_EQ(supervise(state, in, kDefaultLimits, 1).state.faults,
            bit(Fault::supply_low) | bit(Fault::link_lost));
}

// That nothing is near holds for as long as a host may be silent.
TEST(SupervisorEdges, NothingIsNearToTheTick) {
  Board board;
  board.press({0.0f, 0.0f, 2.0f});
  board.in.model_valid_ticks = 0;
  const std::uint32_t silent = board.limits.link_silent_ticks;
  const auto damped = [&](std::uint32_t age_ticks, std::uint32_t link_age_ticks) {
    board.in.model_age_ticks = age_ticks;
    board.in.link_age_ticks = link_age_ticks;
    return supervise(board.state, board.in, board.limits, 1).state.damping_ticks > 0;
  };
  EXPECT_FALSE(damped(silent, silent + 1));
  EXPECT_TRUE(damped(silent + 1, silent + 1));
  EXPECT_FALSE(damped(silent + 1, silent));
  // What such a model asks for all the same, until then.
  board.in.model_age_ticks = silent;
  EXPECT_EQ(supervise(board.state, board.in, board.limits, 1).state.force_N.z, 2.0f);
}

// Damped, then told that nothing is near: the force of the next contact begins at zero.
TEST(SupervisorEdges, AForceThatWasLostComesBackFromZero) {
  for (const std::uint32_t ticks_of_nothing : {0u, 200u}) {
    Board board;
    board.press({0.0f, 0.0f, 2.0f});
    board.in.model_age_ticks = 5000;
    board.steps(30);
    ASSERT_EQ(board.state.damping_ticks, 30u);
    board.in.force_N = {};
    board.in.model_valid_ticks = 0;
    board.in.model_age_ticks = 0;
    board.steps(ticks_of_nothing);
    board.in.force_N = {0.0f, 0.0f, 2.0f};
    board.in.model_valid_ticks = 1000;
    board.step();
    EXPECT_EQ(board.state.force_N, Vec3f{}) << ticks_of_nothing;
    board.step();
    EXPECT_NEAR(board.state.force_N.z, 2.0f / 100.0f, 1e-6f);
    board.steps(24);
    EXPECT_NEAR(board.state.force_N.z, 0.5f, 1e-6f);
  }
}

// A model that comes when it is old already does not begin the count anew.
TEST(SupervisorEdges, OnlyAFreshModelEndsTheCountOfDamping) {
  Board board;
  board.press({0.0f, 0.0f, 2.0f});
  board.in.model_age_ticks = 5000;
  board.steps(30);
  board.in.model_age_ticks = 1100;  // fading
  board.step();
  EXPECT_EQ(board.state.damping_ticks, 30u);
  board.in.model_age_ticks = 1000;
  board.step();
  EXPECT_EQ(board.state.damping_ticks, 0u);
}

TEST(SupervisorEdges, LostTicksLetTheForceGoFurther) {
  Board board;
  board.press({0.0f, 0.0f, 1.0f});
  board.in.force_N.z = 5.0f;
  board.step(3);
  EXPECT_FLOAT_EQ(board.state.force_N.z, 1.0f + 3.0f * 0.5f);
}

// While the tip is damped for want of a model the controller of passivity adds nothing, from the first tick
// on.
TEST(SupervisorEdges, TheDampersDoNotAddUp) {
  Board board;
  board.press({});
  board.state.passivity = {.balance_J = -5e-3f, .damping_N = {1.0f, 0.0f, 0.0f}};
  board.in.tip_velocity_m_s = {0.1f, 0.0f, 0.0f};
  EXPECT_NEAR(supervise(board.state, board.in, board.limits, 1).state.force_N.x, 0.2f, 1e-6f);
  EXPECT_NEAR(supervise(board.state, board.in, board.limits, 1).state.passivity.damping_N.x, 0.2f, 1e-6f);
  board.in.model_age_ticks = 5000;
  board.in.force_N = {0.0f, 0.0f, 1.0f};
  for (int tick = 0; tick < 3; ++tick) {
    board.step();
    EXPECT_NEAR(board.state.force_N.x, 0.2f, 1e-6f);
    EXPECT_EQ(board.state.passivity.damping_N, Vec3f{});
  }
}

TEST(SupervisorEdges, AProgramThatIsGoneEndsModeDirectToTheTick) {
  const auto mode_after = [](std::uint32_t mode_age_ticks, std::uint32_t age_ticks) {
    const SupervisorState state{.mode = Mode::direct, .mode_age_ticks = mode_age_ticks};
    const SupervisorInputs in{.direct_age_ticks = age_ticks};
    return supervise(state, in, kDefaultLimits, 1).state.mode;
  };
  const std::uint32_t lost = kDefaultLimits.direct_lost_ticks;
  EXPECT_EQ(mode_after(lost - 1, lost + 1), Mode::direct);
  EXPECT_EQ(mode_after(lost, lost), Mode::direct);
  EXPECT_EQ(mode_after(lost, lost + 1), Mode::idle);
}

// Of a model that has been in use for too long the force goes no farther than before; how far that is, is
// known of the model's own force alone, and anew when nothing is near.
TEST(SupervisorEdges, HowFarAForceMayGoIsThatOfTheModelsOwn) {
  Board board;
  board.press({0.0f, 0.0f, 2.0f});
  EXPECT_EQ(board.state.grown_N, 2.0f);
  // Damped, by what the passivity controller takes back: that is not the model's.
  board.state.passivity.debt_J = 5e-3f;
  board.in.tip_velocity_m_s = {0.0f, 0.0f, 0.2f};
  board.step();
  EXPECT_GT(norm(board.state.passivity.damping_N), 0.3f);
  EXPECT_NEAR(board.state.grown_N, 2.0f, 1e-6f);
  board.state.passivity = {};
  board.in.tip_velocity_m_s = {};
  // Too long in use, of a horizon of a single tick, too: the force goes, the bound stays.
  board.in.model_use_ticks = board.in.model_growth_ticks + 1;
  board.in.model_valid_ticks = 1;
  board.in.force_N = {0.0f, 0.0f, 1.0f};
  board.steps(5);
  EXPECT_EQ(board.state.force_N.z, 1.0f);
  EXPECT_NEAR(board.state.grown_N, 2.0f, 1e-6f);
  // Nothing is near: there is no force that could go on.
  board.in.model_valid_ticks = 0;
  board.in.force_N = {};
  board.steps(5);
  EXPECT_EQ(board.state.grown_N, 0.0f);
}

// The model that comes next asks for no more than is rendered: nothing begins anew.
TEST(SupervisorEdges, AModelThatAsksForLessNeedsNoSoftStart) {
  for (const float asked_N : {0.0f, 1.0f, 2.0f}) {
    Board board;
    board.press({0.0f, 0.0f, 2.0f});
    board.in.model_use_ticks = board.in.model_growth_ticks + 1;
    board.step();
    ASSERT_TRUE(board.state.growth_had_ended);
    board.in.model_use_ticks = 0;
    board.in.force_N = {0.0f, 0.0f, asked_N};
    const std::uint32_t before = board.state.soft_start_ticks;
    board.step();
    EXPECT_FALSE(board.state.growth_had_ended);
    EXPECT_EQ(board.state.soft_start_ticks, before + 1) << asked_N;
  }
}

}  // namespace
}  // namespace palpate::firmware
