// The numbers of supervisor.hpp once more, from docs/safety.md and docs/protocol.md: who changes one by
// mistake hears of it, and who means it changes both.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "firmware/core/supervisor.hpp"
#include "palpate/BoardStatus_1_0.h"
#include "palpate/Command_1_0.h"

namespace palpate::firmware {
namespace {

TEST(SupervisorDefaults, LimitsAreThoseOfThePage) {
  const Limits limits;
  EXPECT_EQ(limits.boot_ticks, 20u);
  EXPECT_EQ(limits.arming_window_ticks, 1000u);
  EXPECT_EQ(limits.soft_start_ticks, 100u);
  EXPECT_EQ(limits.peak_force_N, 8.5f);
  EXPECT_EQ(limits.force_step_N, 0.5f);
  EXPECT_EQ(limits.force_fault_N, 100.0f);
  EXPECT_EQ(limits.model_horizon_ticks, 1000u);
  EXPECT_EQ(limits.model_fade_ticks, 200u);
  EXPECT_EQ(limits.link_silent_ticks, 300u);
  EXPECT_EQ(limits.damping_N_s_m, 2.0f);
  EXPECT_EQ(limits.damping_force_N, 1.0f);
  EXPECT_EQ(limits.damping_ticks, 1000u);
  EXPECT_EQ(limits.link_lost_ticks, 10'000u);
  EXPECT_EQ(limits.energy_J, 0.5f);
  EXPECT_EQ(limits.energy_leak_W, 0.5f);
  EXPECT_EQ(limits.passivity_allowance_J, 0.5e-3f);
  EXPECT_EQ(limits.passivity_most_J, 10e-3f);
  EXPECT_EQ(limits.direct_force_N, 5.0f);
  EXPECT_EQ(limits.direct_force_step_N, 0.5f);
  EXPECT_EQ(limits.direct_energy_J, 4.0f);
  EXPECT_EQ(limits.direct_hold_ticks, 20u);
  EXPECT_EQ(limits.direct_fade_ticks, 50u);
  EXPECT_EQ(limits.direct_lost_ticks, 1000u);
  EXPECT_EQ(limits.joint_step_rad, 0.05f);
  EXPECT_EQ(limits.tip_speed_m_s, 2.5f);
  EXPECT_EQ(limits.calibration_ticks, 100u);
  EXPECT_EQ(limits.calibration_motion_count, 1);
  EXPECT_EQ(limits.motor_current_A, (std::array{7.0f, 7.0f, 7.0f}));
  EXPECT_EQ(limits.over_current_ratio, 1.5f);
  EXPECT_EQ(limits.over_current_ticks, 5u);
  EXPECT_EQ(limits.current_tracking_A, 1.5f);
  EXPECT_EQ(limits.current_tracking_ticks, 10u);
  EXPECT_EQ(limits.motor_continuous_A, (std::array{1.24f, 1.24f, 1.24f}));
  EXPECT_EQ(limits.winding_share, 0.25f);
  EXPECT_EQ(limits.winding_s, 12.0f);
  EXPECT_EQ(limits.housing_s, 900.0f);
  EXPECT_EQ(limits.heat_fold, 0.8f);
  EXPECT_EQ(limits.heat_fault, 1.1f);
  EXPECT_EQ(limits.heat_at_start, 0.0f);
  EXPECT_EQ(limits.missed_deadline_weight, 100u);
  EXPECT_EQ(limits.missed_deadline_bucket, 500u);
}

TEST(SupervisorDefaults, ThePassivityControllerHasItsOwnOfThem) {
  const PassivityLimits of = passivity_limits({.damping_N_s_m = 1.0f,
                                               .damping_force_N = 2.0f,
                                               .passivity_allowance_J = 3.0f,
                                               .passivity_most_J = 4.0f});
  EXPECT_EQ(of.damping_N_s_m, 1.0f);
  EXPECT_EQ(of.force_N, 2.0f);
  EXPECT_EQ(of.allowance_J, 3.0f);
  EXPECT_EQ(of.most_J, 4.0f);
}

// Numbers that travel over the link.
TEST(SupervisorDefaults, ModesActionsAndFaultsHaveTheirNumbers) {
  const auto number = [](auto value) { return static_cast<unsigned>(value); };
  EXPECT_EQ(number(Mode::boot), palpate_BoardStatus_1_0_MODE_BOOT);
  EXPECT_EQ(number(Mode::idle), palpate_BoardStatus_1_0_MODE_IDLE);
  EXPECT_EQ(number(Mode::calibrate), palpate_BoardStatus_1_0_MODE_CALIBRATE);
  EXPECT_EQ(number(Mode::render), palpate_BoardStatus_1_0_MODE_RENDER);
  EXPECT_EQ(number(Mode::fault), palpate_BoardStatus_1_0_MODE_FAULT);
  EXPECT_EQ(number(Mode::direct), palpate_BoardStatus_1_0_MODE_DIRECT);
  EXPECT_EQ(number(Mode::suspended), palpate_BoardStatus_1_0_MODE_SUSPENDED);
  EXPECT_EQ(kModes, 7u);
  EXPECT_EQ(number(Action::nothing), 0u);
  EXPECT_EQ(number(Action::arm_request), palpate_Command_Request_1_0_ARM_REQUEST);
  EXPECT_EQ(number(Action::arm_confirm), palpate_Command_Request_1_0_ARM_CONFIRM);
  EXPECT_EQ(number(Action::disarm), palpate_Command_Request_1_0_DISARM);
  EXPECT_EQ(number(Action::calibrate), palpate_Command_Request_1_0_CALIBRATE);
  EXPECT_EQ(number(Action::clear_fault), palpate_Command_Request_1_0_CLEAR_FAULT);
  EXPECT_EQ(number(Action::stop), palpate_Command_Request_1_0_STOP);
  EXPECT_EQ(number(Action::arm_direct), palpate_Command_Request_1_0_ARM_DIRECT);
  constexpr std::array kByBit{Fault::emergency_stop,   Fault::stop_command,      Fault::not_a_number,
                              Fault::encoder_jump,     Fault::over_speed,        Fault::outside_workspace,
                              Fault::over_current,     Fault::force_implausible, Fault::deadline_missed,
                              Fault::link_lost,        Fault::energy_created,    Fault::motor_heat,
                              Fault::current_tracking, Fault::supply_low};
  EXPECT_EQ(bit(Fault::none), 0u);
  for (std::size_t i = 0; i < kByBit.size(); ++i) EXPECT_EQ(bit(kByBit[i]), 1u << i) << i;
}

TEST(SupervisorDefaults, OutputsAreOnInTwoModesAndArmedInThree) {
  for (std::size_t i = 0; i < kModes; ++i) {
    const auto mode = static_cast<Mode>(i);
    EXPECT_EQ(outputs_on(mode), mode == Mode::render || mode == Mode::direct) << i;
    EXPECT_EQ(is_armed(mode), outputs_on(mode) || mode == Mode::suspended) << i;
  }
}

// Nothing is on, latched, open or counted before the first tick.
TEST(SupervisorDefaults, ABoardBeginsWithNothing) {
  const SupervisorState state;
  EXPECT_EQ(state.mode, Mode::boot);
  EXPECT_EQ(state.faults, 0u);
  EXPECT_EQ(state.mode_age_ticks, 0u);
  EXPECT_EQ(state.token, 0u);
  EXPECT_EQ(state.token_age_ticks, 0u);
  EXPECT_FALSE(state.token_is_direct);
  EXPECT_EQ(state.token_node, 0u);
  EXPECT_EQ(state.over_current_ticks, 0u);
  EXPECT_EQ(state.tracking_ticks, 0u);
  EXPECT_EQ(state.missed_deadline_level, 0u);
  EXPECT_TRUE(state.position_trusted);
  EXPECT_EQ(state.force_N, Vec3f{});
  EXPECT_FALSE(state.force_was_lost);
  EXPECT_FALSE(state.growth_had_ended);
  EXPECT_EQ(state.grown_N, 0.0f);
  EXPECT_EQ(state.soft_start_ticks, 0u);
  EXPECT_EQ(state.damping_ticks, 0u);
  EXPECT_EQ(state.energy_J, 0.0f);
  EXPECT_EQ(state.passivity, PassivityState{});
  EXPECT_EQ(state.passivity.balance_J, 0.0f);
  EXPECT_EQ(state.passivity.debt_J, 0.0f);
  const Decision decision;
  EXPECT_FALSE(decision.outputs_on);
  EXPECT_FALSE(decision.force_limited);
  EXPECT_FALSE(decision.calibration_begins);
  EXPECT_FALSE(decision.calibration_ends);
  EXPECT_EQ(decision.outcome.action, Action::nothing);
  EXPECT_EQ(decision.outcome.status, Status::ok);
  EXPECT_EQ(decision.outcome.token, 0u);
  const CurrentLimit currents;
  EXPECT_EQ(currents.setpoint_A, (std::array<float, 3>{}));
  EXPECT_FALSE(currents.limited);
  EXPECT_TRUE(currents.finite);
}

// What a tick brings that nobody fills in is what harms nothing.
TEST(SupervisorDefaults, ATickBringsNothingByItself) {
  const SupervisorInputs in;
  EXPECT_EQ(in.tick, 0u);
  EXPECT_EQ(in.elapsed_ticks, 1u);
  EXPECT_EQ(in.missed_deadlines, 0u);
  EXPECT_FALSE(in.emergency_stop_open);
  EXPECT_FALSE(in.supply_low);
  EXPECT_EQ(in.command.action, Action::nothing);
  EXPECT_EQ(in.command.token, 0u);
  EXPECT_EQ(in.command_node, 0u);
  EXPECT_EQ(in.joint_step_rad, 0.0f);
  EXPECT_EQ(in.tip_speed_m_s, 0.0f);
  EXPECT_TRUE(in.inside_workspace);
  EXPECT_TRUE(in.at_rest);
  EXPECT_EQ(in.current_error_A, 0.0f);
  EXPECT_EQ(in.hottest_motor, 0.0f);
  EXPECT_EQ(in.link_age_ticks, 0u);
  EXPECT_EQ(in.model_sequence, 0u);
  EXPECT_EQ(in.model_age_ticks, 0u);
  EXPECT_EQ(in.model_valid_ticks, 0u);
  EXPECT_EQ(in.model_growth_ticks, 0u);
  EXPECT_EQ(in.model_use_ticks, 0u);
  EXPECT_EQ(in.correction_J, 0.0f);
  EXPECT_EQ(in.direct_age_ticks, UINT32_MAX);
}

}  // namespace
}  // namespace palpate::firmware
