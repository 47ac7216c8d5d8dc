#include "firmware/core/passivity.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::firmware {
namespace {

constexpr PassivityLimits kLimits{
    .allowance_J = 1e-3f, .most_J = 0.02f, .damping_N_s_m = 2.0f, .force_N = 1.0f};
constexpr float kTick_s = 1e-3f;
// Of sums of a thousand products below 1 mJ in single precision.
constexpr float kRounding_J = 1e-8f;

TEST(Passivity, ASampledAndHeldSpringCreatesWhatTheHoldIsLate) {
  // In and out at 1 mm a tick: each force acts on the move behind it, so that pressing takes
  // k d^2 (0 + 1 + ... + 4) and leaving gives k d^2 (5 + 4 + ... + 1).
  constexpr float kStiffness_N_m = 100.0f, kStep_m = 1e-3f;
  PassivityState state;
  float force_N = 0.0f, tip_m = 0.0f;
  for (int i = 0; i < 10; ++i) {
    const float step_m = i < 5 ? kStep_m : -kStep_m;
    tip_m += step_m;
    state = observe(state, {.force_N = {force_N, 0, 0}, .step_m = {step_m, 0, 0}, .touches = true}, kLimits);
    force_N = kStiffness_N_m * tip_m;
  }
  EXPECT_NEAR(state.balance_J, kStiffness_N_m * kStep_m * kStep_m * (10.0f - 15.0f), kRounding_J);
  EXPECT_EQ(state.debt_J, 0.0f);
  EXPECT_GT(excess_J(state, {}), 0.0f);
}

TEST(Passivity, WhatOneContactHasTakenIsNoCreditInTheNext) {
  PassivityState state;
  state = observe(state, {.force_N = {1, 0, 0}, .step_m = {0.01f, 0, 0}, .touches = true}, kLimits);
  EXPECT_FLOAT_EQ(state.balance_J, 0.01f);
  state = observe(state, {.touches = false}, kLimits);
  EXPECT_EQ(state.balance_J, 0.0f);
  // What was created is not forgotten that way.
  state = observe(state, {.force_N = {1, 0, 0}, .step_m = {-0.01f, 0, 0}, .touches = true}, kLimits);
  state = observe(state, {.touches = false}, kLimits);
  EXPECT_FLOAT_EQ(state.balance_J, -0.01f);
}

TEST(Passivity, ADebtOfCorrectionsIsPaidByDampingOnly) {
  PassivityState state;
  state = observe(
      state, {.force_N = {1, 0, 0}, .step_m = {0.1f, 0, 0}, .correction_J = 5e-3f, .touches = true}, kLimits);
  EXPECT_FLOAT_EQ(state.balance_J, 0.1f);
  EXPECT_FLOAT_EQ(state.debt_J, 5e-3f);
  EXPECT_FLOAT_EQ(excess_J(state, kLimits), 4e-3f);
  // Friction of the body takes energy, which pays nothing.
  state = observe(state, {.force_N = {1, 0, 0}, .step_m = {0.1f, 0, 0}, .touches = true}, kLimits);
  EXPECT_FLOAT_EQ(state.debt_J, 5e-3f);
  state.damping_N = {0.5f, 0, 0};
  state = observe(state, {.force_N = {1.5f, 0, 0}, .step_m = {0.004f, 0, 0}, .touches = true}, kLimits);
  EXPECT_FLOAT_EQ(state.debt_J, 3e-3f);
  // A model that takes too much is no credit for one that gives.
  state.damping_N = {};
  state = observe(state, {.correction_J = -1.0f, .touches = true}, kLimits);
  EXPECT_EQ(state.debt_J, 0.0f);
}

TEST(Passivity, NeitherAccountRemembersMoreThanItMay) {
  PassivityState state;
  state = observe(state, {.force_N = {-1, 0, 0}, .step_m = {5, 0, 0}, .correction_J = 5.0f, .touches = true},
                  kLimits);
  EXPECT_EQ(state.balance_J, -kLimits.most_J);
  EXPECT_EQ(state.debt_J, kLimits.most_J);
}

TEST(Passivity, DampingTakesTheExcessInATickOrWhatItMay) {
  const auto along = [](float excess_J, const Vec3f& velocity_m_s) {
    return passivity_damping({.balance_J = -(excess_J + kLimits.allowance_J)}, velocity_m_s, kTick_s,
                             kLimits);
  };
  // 0.1 mJ in one tick at 0.5 m/s: 0.2 N; and along the motion.
  const Vec3f exact_N = along(1e-4f, {0.0f, -0.5f, 0.0f});
  EXPECT_NEAR(exact_N.y, -0.2f, 1e-5f);
  EXPECT_EQ(exact_N.x, 0.0f);
  EXPECT_NEAR(norm(along(1.0f, {0.1f, 0.0f, 0.0f})), 0.2f, 1e-6f);   // 2 N s/m
  EXPECT_NEAR(norm(along(1.0f, {0.0f, 0.0f, 10.0f})), 1.0f, 1e-6f);  // 1 N
  EXPECT_EQ(norm(along(1.0f, {})), 0.0f);
  EXPECT_EQ(norm(along(0.0f, {1.0f, 0.0f, 0.0f})), 0.0f);
  EXPECT_EQ(norm(passivity_damping({.balance_J = 1.0f}, {1.0f, 0.0f, 0.0f}, kTick_s, kLimits)), 0.0f);
}

TEST(Passivity, WhoSetsNothingDampsNothing) {
  const PassivityLimits none;
  EXPECT_EQ(none.allowance_J, 0.0f);
  EXPECT_EQ(none.most_J, 0.0f);
  EXPECT_EQ(none.damping_N_s_m, 0.0f);
  EXPECT_EQ(none.force_N, 0.0f);
  EXPECT_EQ(
      norm(passivity_damping({.balance_J = -1.0f}, {1.0f, 0.0f, 0.0f}, kTick_s, {.damping_N_s_m = 1.0f})),
      0.0f);
  // Without a word of it nothing is touched: no credit.
  EXPECT_EQ(observe({.balance_J = 1.0f}, {}, kLimits).balance_J, 0.0f);
}

TEST(Passivity, WhatIsCreatedStaysAtTheAllowance) {
  // A spring that gives back half as much again, pressed and left by a hand that goes its way: 1 m/s, 5 mm.
  PassivityState state;
  float force_N = 0.0f, least_J = 0.0f;
  for (int tick = 0; tick < 2000; ++tick) {
    const float phase = static_cast<float>(tick % 100) / 100.0f;
    const bool presses = phase < 0.5f;
    const float depth_m = 5e-3f * (presses ? 2.0f * phase : 2.0f - 2.0f * phase);
    const float step_m = presses ? 1e-4f : -1e-4f;
    state = observe(state, {.force_N = {force_N, 0, 0}, .step_m = {step_m, 0, 0}, .touches = depth_m > 0.0f},
                    kLimits);
    state.damping_N = passivity_damping(state, {step_m / kTick_s, 0, 0}, kTick_s, kLimits);
    force_N = (presses ? 40.0f : 60.0f) * depth_m + state.damping_N.x;
    least_J = std::min(least_J, state.balance_J);
  }
  // Each round creates 20 N/m (5 mm)^2 / 2 = 0.25 mJ; damping may take 2 N s/m (0.1 m/s)^2 0.1 s = 2 mJ.
  EXPECT_LT(least_J, -0.5f * kLimits.allowance_J);
  EXPECT_GT(least_J, -1.3f * kLimits.allowance_J);
}

}  // namespace
}  // namespace palpate::firmware
