// The passivity controller in the supervisor: only over a model's force, and within all limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "firmware/core/supervisor.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kSeed = 7;
constexpr float kTick_s = 1e-3f;
constexpr float kSpeed_m_s = 0.1f;
// Of forces up to 10 N after a few operations.
constexpr float kForceRounding_N = 4e-6f;

// A tip that moves along x, with a fresh model's force.
struct Rendering {
  Limits limits{};
  SupervisorState state{};
  SupervisorInputs in{};
  float given_J = 0.0f;  // to the hand, less taken from it, since outputs came on
  float largest_step_N = 0.0f;

  explicit Rendering(Action how = Action::arm_request) {
    in.model_sequence = 1;
    in.model_valid_ticks = 100;
    for (std::uint32_t i = 0; i < limits.boot_ticks; ++i) tick({}, 0.0f);
    in.command = {how, 0};
    tick({}, 0.0f);
    in.command = {Action::arm_confirm, state.token};
    for (std::uint32_t i = 0; i <= limits.soft_start_ticks; ++i) tick({}, 0.0f);
  }

  // The tip has moved at `velocity_m_s` since the last tick; what is asked for now.
  void tick(const Vec3f& force_N, float velocity_m_s) {
    in.tip_velocity_m_s = {velocity_m_s, 0.0f, 0.0f};
    in.tip_step_m = in.tip_velocity_m_s * kTick_s;
    in.tip_speed_m_s = std::fabs(velocity_m_s);
    in.force_N = force_N;
    in.direct_force_N = force_N;
    in.direct_age_ticks = 0;
    given_J -= dot(state.force_N, in.tip_step_m);
    const Vec3f before_N = state.force_N;
    state = supervise(state, in, limits, kSeed).state;
    largest_step_N = std::max(largest_step_N, norm(state.force_N - before_N));
    in.command = {};
    in.correction_J = 0.0f;
    ++in.tick;
  }
};

// Pressed 5 mm and left, ten times a second, against a spring that gives half as much again as it has taken.
float created_J(Rendering& hand) {
  float most_J = 0.0f;
  for (int tick = 0; tick < 2000; ++tick) {
    const float phase = static_cast<float>(tick % 100) / 100.0f;
    const bool presses = phase < 0.5f;
    const float depth_m = 5e-3f * (presses ? 2.0f * phase : 2.0f - 2.0f * phase);
    hand.tick({(presses ? 40.0f : 60.0f) * depth_m, 0.0f, 0.0f}, presses ? kSpeed_m_s : -kSpeed_m_s);
    most_J = std::max(most_J, hand.given_J);
  }
  return most_J;
}

TEST(PassivityControl, HoldsWhatAModelCreates) {
  Rendering hand;
  EXPECT_LT(created_J(hand), 1.3f * hand.limits.passivity_allowance_J);
  EXPECT_GT(hand.given_J, 0.0f);
  Rendering let;
  let.limits.passivity_allowance_J = 1.0f;
  EXPECT_GT(created_J(let), 4e-3f);  // 20 times 0.25 mJ
}

TEST(PassivityControl, LeavesAPassiveModelsForceToTheBit) {
  Rendering hand;
  for (int i = 0; i < 10; ++i) hand.tick({1.0f, 0.3f, 0.0f}, 0.0f);
  for (int tick = 0; tick < 1000; ++tick) {
    const float phase = static_cast<float>(tick) * 0.05f;
    // A spring of 50 N/m from 1 N up: being held it creates 0.13 mJ in these eight rounds.
    const Vec3f force_N{1.1f - 0.1f * std::cos(phase), 0.3f, 0.0f};
    hand.tick(force_N, kSpeed_m_s * std::sin(phase));
    ASSERT_EQ(hand.state.force_N, force_N) << tick;
  }
}

TEST(PassivityControl, TakesBackACorrectionThatFrictionHides) {
  Rendering hand;
  const Vec3f friction_N{1.0f, 0.0f, 0.0f};
  for (int i = 0; i < 100; ++i) hand.tick(friction_N, kSpeed_m_s);
  constexpr float kDebt_J = 2e-3f;
  hand.in.correction_J = kDebt_J;
  hand.tick(friction_N, kSpeed_m_s);
  const float added_N = hand.limits.damping_N_s_m * kSpeed_m_s;
  int damped = 0;
  for (; hand.state.force_N.x > friction_N.x; ++damped) {
    ASSERT_LE(hand.state.force_N.x, friction_N.x + added_N + kForceRounding_N);
    ASSERT_LT(damped, 1000);
    hand.tick(friction_N, kSpeed_m_s);
  }
  // (2 mJ - 0.5 mJ) / (0.2 N x 0.1 m/s): 75 ticks.
  EXPECT_NEAR(damped, (kDebt_J - hand.limits.passivity_allowance_J) / (added_N * kSpeed_m_s * kTick_s), 1.0f);
  EXPECT_EQ(hand.state.force_N, friction_N);
}

TEST(PassivityControl, StaysWithinPeakAndStep) {
  Rendering hand;
  const Vec3f peak_N{hand.limits.peak_force_N, 0.0f, 0.0f};
  for (int i = 0; i < 100; ++i) hand.tick(peak_N, 0.0f);
  hand.in.correction_J = 1.0f;
  for (int i = 0; i < 100; ++i) {
    hand.tick(peak_N, 1.0f);
    ASSERT_LE(norm(hand.state.force_N), hand.limits.peak_force_N + kForceRounding_N);
  }
  // Nothing was added, so nothing was paid of what is remembered.
  EXPECT_NEAR(hand.state.passivity.debt_J, hand.limits.passivity_most_J, 1e-7f);
  for (int i = 0; i < 100; ++i) hand.tick({}, i % 2 == 0 ? 1.0f : -1.0f);
  EXPECT_LE(hand.largest_step_N, hand.limits.force_step_N + kForceRounding_N);
}

TEST(PassivityControl, AProgramsForceIsItsOwn) {
  Rendering hand(Action::arm_direct);
  ASSERT_EQ(hand.state.mode, Mode::direct);
  hand.in.correction_J = 1.0f;
  for (int i = 0; i < 200; ++i) hand.tick({-1.0f, 0.0f, 0.0f}, kSpeed_m_s);
  EXPECT_EQ(hand.state.force_N, (Vec3f{-1.0f, 0.0f, 0.0f}));
  EXPECT_EQ(hand.state.passivity, PassivityState{});
}

TEST(PassivityControl, ACorrectionOfWhatWasNotFeltIsNone) {
  Rendering hand;
  hand.in.command = {Action::disarm, 0};
  hand.tick({}, 0.0f);
  hand.in.command = {Action::arm_request, 0};
  hand.tick({}, 0.0f);
  hand.in.command = {Action::arm_confirm, hand.state.token};
  for (std::uint32_t i = 0; i < hand.limits.soft_start_ticks; ++i) {
    hand.in.correction_J = 1e-3f;
    hand.tick({1.0f, 0.0f, 0.0f}, 0.0f);
    ASSERT_EQ(hand.state.passivity.debt_J, 0.0f) << i;
  }
  hand.tick({1.0f, 0.0f, 0.0f}, 0.0f);
  hand.in.correction_J = 1e-3f;
  hand.tick({1.0f, 0.0f, 0.0f}, 0.0f);
  EXPECT_FLOAT_EQ(hand.state.passivity.debt_J, 1e-3f);
}

TEST(PassivityControl, BeginsAnewWhenOutputsComeOn) {
  Rendering hand;
  hand.in.correction_J = 1.0f;
  hand.tick({}, 0.0f);
  EXPECT_GT(hand.state.passivity.debt_J, 0.0f);
  hand.in.command = {Action::disarm, 0};
  hand.tick({}, 0.0f);
  EXPECT_EQ(hand.state.passivity, PassivityState{});
}

TEST(PassivityControl, ACorrectionThatIsNoNumberIsAFault) {
  Rendering hand;
  hand.in.correction_J = NAN;
  hand.tick({}, 0.0f);
  EXPECT_EQ(hand.state.mode, Mode::fault);
  EXPECT_EQ(hand.state.faults, bit(Fault::not_a_number));
}

}  // namespace
}  // namespace palpate::firmware
