// What the supervisor does while a link is silent and when it returns, and the energy that it watches.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "firmware/core/supervisor.hpp"
#include "shared/device/count_estimator.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kSeed = 0x12345678u;
constexpr std::uint32_t kValid_ticks = 200;
constexpr std::uint32_t kGrowth_ticks = 97;
// Rounding of the limited force: a few operations on numbers up to 10 N.
constexpr float kForceRounding_N = 4e-6f;
constexpr Vec3f kForce_N{0.0f, 0.0f, 4.0f};
constexpr Vec3f kVelocity_m_s{0.1f, 0.0f, 0.0f};

// A board that renders, tick by tick, with a link that is heard or not.
class LinkLoss : public ::testing::Test {
 protected:
  void SetUp() override {
    in_.force_N = kForce_N;
    in_.model_sequence = 1;
    in_.model_valid_ticks = kValid_ticks;
    in_.model_growth_ticks = kGrowth_ticks;
    ticks(limits_.boot_ticks, true);
    const std::uint32_t token = command(Action::arm_request).outcome.token;
    command(Action::arm_confirm, token);
    ticks(limits_.soft_start_ticks + 50, true);
    ASSERT_EQ(state_.force_N, kForce_N);
  }

  // One tick. Heard: a fresh model has come, too.
  Decision tick(bool heard) {
    in_.link_age_ticks = heard ? 0 : in_.link_age_ticks + in_.elapsed_ticks;
    in_.model_age_ticks = heard ? 30 : in_.model_age_ticks + in_.elapsed_ticks;
    in_.model_use_ticks = heard ? 0 : in_.model_use_ticks + in_.elapsed_ticks;
    const Vec3f before_N = state_.force_N;
    decision_ = supervise(state_, in_, limits_, kSeed);
    state_ = decision_.state;
    largest_step_N_ = std::max(largest_step_N_, norm(state_.force_N - before_N));
    in_.tick += in_.elapsed_ticks;
    in_.command = {};
    return decision_;
  }
  Decision ticks(std::uint32_t count, bool heard) {
    for (std::uint32_t i = 0; i < count; ++i) tick(heard);
    return decision_;
  }
  // What the model in use is; it is as fresh as one is.
  void say_nothing_is_near() {
    in_.force_N = {};
    in_.model_valid_ticks = 0;
    tick(true);
  }
  void near_again() {
    in_.force_N = kForce_N;
    in_.model_valid_ticks = kValid_ticks;
  }
  // With fresh models, the first of them a tick before it begins to rise where outputs were on.
  void expect_soft_start() {
    if (state_.force_was_lost) {
      EXPECT_EQ(tick(true).state.force_N, Vec3f{});
    }
    for (std::uint32_t i = 1; i <= limits_.soft_start_ticks; ++i) {
      ASSERT_NEAR(norm(tick(true).state.force_N),
                  norm(kForce_N) * static_cast<float>(i) / static_cast<float>(limits_.soft_start_ticks),
                  kForceRounding_N);
    }
  }
  // From what a tick may bring at once on, or from the force until then; to kForce_N.
  void expect_soft_start_from(float from_N) {
    const float rise_N = norm(kForce_N) / static_cast<float>(limits_.soft_start_ticks);
    EXPECT_NEAR(norm(tick(true).state.force_N), from_N, rise_N);
    largest_step_N_ = 0.0f;
    ticks(static_cast<std::uint32_t>((norm(kForce_N) - from_N) / rise_N) + 1, true);
    EXPECT_EQ(state_.force_N, kForce_N);
    EXPECT_NEAR(largest_step_N_, rise_N, kForceRounding_N);
  }
  Decision command(Action action, std::uint32_t token = 0) {
    in_.command = {action, token};
    return tick(in_.link_age_ticks == 0);
  }
  // Until outputs are off; returns how long that took.
  std::uint32_t lose_link() {
    for (std::uint32_t silent = 1; silent < 10'000; ++silent)
      if (!tick(false).outputs_on) return silent;
    return 0;
  }

  Limits limits_{};
  SupervisorState state_{};
  SupervisorInputs in_{};
  Decision decision_{};
  float largest_step_N_ = 0.0f;
};

TEST_F(LinkLoss, FadesDampsAndSwitchesOffInItsTimes) {
  in_.tip_velocity_m_s = kVelocity_m_s;
  ticks(kValid_ticks - 30, false);
  EXPECT_EQ(state_.force_N, kForce_N);
  largest_step_N_ = 0.0f;
  ticks(limits_.model_fade_ticks - 1, false);
  EXPECT_GT(state_.force_N.z, 0.0f);
  EXPECT_LT(state_.force_N.z, 0.1f);
  tick(false);
  // Against the motion, which the hand feels the other way round.
  EXPECT_FLOAT_EQ(state_.force_N.x, limits_.damping_N_s_m * kVelocity_m_s.x);
  EXPECT_EQ(state_.force_N.z, 0.0f);
  EXPECT_TRUE(decision_.outputs_on);
  EXPECT_LE(largest_step_N_, limits_.force_step_N);
  const std::uint32_t rest = lose_link();
  EXPECT_EQ(rest, limits_.damping_ticks);
  EXPECT_EQ(state_.mode, Mode::suspended);
  EXPECT_EQ(state_.faults, 0);
  EXPECT_EQ(state_.force_N, Vec3f{});
}

TEST_F(LinkLoss, ThirtyMillisecondsOfJitterChangeNothing) {
  for (int i = 0; i < 200; ++i) {
    ticks(static_cast<std::uint32_t>(i) % 31, false);
    tick(true);
    ASSERT_EQ(state_.force_N, kForce_N);
    ASSERT_EQ(state_.mode, Mode::render);
  }
}

// A model errs stiffer the longer it is used: its force ends to grow, and the next one takes it up from
// there.
TEST_F(LinkLoss, TheForceOfAModelInUseForTooLongDoesNotGrow) {
  const Vec3f first_N = kForce_N * 0.5f;
  in_.force_N = first_N;
  ticks(20, true);
  ticks(kGrowth_ticks, false);
  EXPECT_EQ(state_.force_N, first_N);
  in_.force_N = kForce_N;
  ticks(kValid_ticks - 30 - kGrowth_ticks, false);
  EXPECT_NEAR(norm(state_.force_N), norm(first_N), kForceRounding_N);
  EXPECT_TRUE(decision_.force_limited);
  // Less than then is as the model has it, and back to where it was.
  in_.force_N = first_N * 0.25f;
  in_.model_age_ticks = in_.model_use_ticks = kGrowth_ticks;
  ticks(10, false);
  EXPECT_EQ(state_.force_N, in_.force_N);
  in_.force_N = kForce_N;
  ticks(10, false);
  EXPECT_NEAR(norm(state_.force_N), norm(first_N), kForceRounding_N);
  expect_soft_start_from(norm(first_N));
}

TEST_F(LinkLoss, UntilThenItGrows) {
  in_.force_N = kForce_N * 0.5f;
  ticks(20, true);
  ticks(kGrowth_ticks - 20, false);
  in_.force_N = kForce_N;
  ticks(20, false);
  EXPECT_EQ(state_.force_N, kForce_N);
}

TEST_F(LinkLoss, WhatIsTouchedByAnOldModelAloneIsFeltALittle) {
  in_.force_N = {};
  ticks(20, true);
  ticks(kGrowth_ticks, false);
  in_.force_N = kForce_N;
  ticks(30, false);
  EXPECT_NEAR(norm(state_.force_N), limits_.force_step_N, kForceRounding_N);
  expect_soft_start_from(limits_.force_step_N);
}

TEST_F(LinkLoss, AHostThatSaysThatNothingIsNearOwesNoModel) {
  // The tip is far from the surface: the host has nothing to send but signs of life.
  in_.tip_velocity_m_s = kVelocity_m_s;
  say_nothing_is_near();
  for (int i = 0; i < 200; ++i) {
    ticks(99, false);
    in_.link_age_ticks = 0;
    ASSERT_EQ(state_.force_N, Vec3f{});
  }
  EXPECT_EQ(state_.mode, Mode::render);
  // And the next model is no return: its contact has only begun, and loses nothing.
  near_again();
  in_.force_N = {0.0f, 0.0f, limits_.force_step_N};
  EXPECT_EQ(tick(true).state.force_N, in_.force_N);
  for (float force_N = limits_.force_step_N; force_N <= kForce_N.z; force_N += limits_.force_step_N) {
    in_.force_N.z = force_N;
    ASSERT_EQ(tick(true).state.force_N, in_.force_N);
  }
}

// A model that had to wait, for its basis or for the host, while the tip pressed on: nothing was felt until
// then.
TEST_F(LinkLoss, AContactThatNoModelKnewOfComesBySoftStart) {
  say_nothing_is_near();
  ticks(700, true);
  near_again();
  expect_soft_start_from(limits_.force_step_N);
  // Once: what changes from then on does so as fast as ever.
  in_.force_N = {};
  tick(true);
  EXPECT_NEAR(norm(state_.force_N), norm(kForce_N) - limits_.force_step_N, kForceRounding_N);
}

TEST_F(LinkLoss, AHostThatIsSilentAfterItHasSaidSoIsLost) {
  in_.tip_velocity_m_s = kVelocity_m_s;
  say_nothing_is_near();
  ticks(5000, true);
  ticks(limits_.link_silent_ticks, false);
  EXPECT_EQ(state_.force_N, Vec3f{});
  tick(false);
  EXPECT_FLOAT_EQ(state_.force_N.x, limits_.damping_N_s_m * kVelocity_m_s.x);
  // Heard, it need not say it again to end the damping, and silences do not add up.
  for (int i = 0; i < 5; ++i) {
    ticks(limits_.damping_ticks - 100, false);
    in_.link_age_ticks = 0;
    tick(false);
    ASSERT_TRUE(decision_.outputs_on);
    ASSERT_EQ(state_.force_N, Vec3f{});
  }
  EXPECT_EQ(lose_link(), limits_.link_silent_ticks + limits_.damping_ticks);
  EXPECT_EQ(state_.mode, Mode::suspended);
  // Outputs come back with what it says from then on.
  in_.link_age_ticks = 0;
  ticks(limits_.link_silent_ticks, false);
  EXPECT_EQ(state_.mode, Mode::suspended);
  EXPECT_TRUE(tick(true).outputs_on);
  ticks(500, true);
  EXPECT_EQ(state_.force_N, Vec3f{});
  // The force has been lost since: however late its model comes, it comes by the soft start.
  near_again();
  expect_soft_start();
}

TEST_F(LinkLoss, AStaleModelOfAHostThatIsHeardIsDampedAndSwitchedOffInTheSameTimes) {
  in_.tip_velocity_m_s = kVelocity_m_s;
  const auto heard = [&] {
    const Decision decision = tick(false);
    in_.link_age_ticks = 0;
    return decision;
  };
  while (in_.model_age_ticks < kValid_ticks) ASSERT_EQ(heard().state.force_N, kForce_N);
  largest_step_N_ = 0.0f;
  while (in_.model_age_ticks < kValid_ticks + limits_.model_fade_ticks - 1) {
    const float before_N = state_.force_N.z;
    ASSERT_LT(heard().state.force_N.z, before_N);
    ASSERT_GT(state_.force_N.z, 0.0f);
  }
  for (std::uint32_t damped = 0; damped < limits_.damping_ticks; ++damped) {
    ASSERT_TRUE(heard().outputs_on) << damped;
    ASSERT_FLOAT_EQ(state_.force_N.x, limits_.damping_N_s_m * kVelocity_m_s.x);
    ASSERT_EQ(state_.force_N.z, 0.0f);
  }
  EXPECT_LE(largest_step_N_, limits_.force_step_N);
  EXPECT_FALSE(heard().outputs_on);
  EXPECT_EQ(state_.mode, Mode::suspended);
  EXPECT_EQ(state_.faults, 0);
  // Within ten seconds it goes on, later it is latched.
  for (std::uint32_t i = 0; i < limits_.link_lost_ticks - 1; ++i) ASSERT_FALSE(heard().outputs_on);
  const SupervisorState at_the_end = state_;
  EXPECT_TRUE(tick(true).outputs_on);
  expect_soft_start();
  state_ = at_the_end;
  in_.model_age_ticks = 2 * kValid_ticks;
  heard();
  EXPECT_FALSE(heard().outputs_on);
  EXPECT_EQ(state_.faults, bit(Fault::link_lost));
}

TEST_F(LinkLoss, AStaleModelWithoutAForceIsDampedToo) {
  // The tip is in the air, and it is not known that nothing is near.
  in_.tip_velocity_m_s = kVelocity_m_s;
  in_.force_N = {};
  for (std::uint32_t i = 0; i < kValid_ticks + limits_.model_fade_ticks; ++i) {
    tick(false);
    in_.link_age_ticks = 0;
  }
  EXPECT_GT(norm(state_.force_N), 0.0f);
  in_.force_N = kForce_N;
  expect_soft_start();
}

TEST_F(LinkLoss, AForceThatHasBegunToFadeComesBackFromThere) {
  for (int i = 0; i < 3; ++i) {
    ticks(99, false);
    in_.link_age_ticks = 0;
  }
  ASSERT_GT(norm(state_.force_N), limits_.force_step_N);
  expect_soft_start_from(norm(state_.force_N));
}

TEST_F(LinkLoss, GoesOnBySoftStartWithinTenSeconds) {
  lose_link();
  ticks(limits_.link_lost_ticks - in_.link_age_ticks, false);
  EXPECT_EQ(state_.mode, Mode::suspended);
  EXPECT_TRUE(tick(true).outputs_on);
  EXPECT_EQ(state_.mode, Mode::render);
  expect_soft_start();
}

TEST_F(LinkLoss, WhileItIsDampedASoftStartToo) {
  in_.tip_velocity_m_s = kVelocity_m_s;
  ticks(kValid_ticks + limits_.model_fade_ticks + 300, false);
  ASSERT_TRUE(decision_.outputs_on);
  // Heard, but no model yet: still damped.
  in_.link_age_ticks = 0;
  ticks(50, false);
  EXPECT_FLOAT_EQ(state_.force_N.x, limits_.damping_N_s_m * kVelocity_m_s.x);
  tick(true);
  EXPECT_LT(norm(state_.force_N), 0.1f);
  ticks(limits_.soft_start_ticks, true);
  EXPECT_EQ(state_.force_N, kForce_N);
}

TEST_F(LinkLoss, LatchesAfterTenSeconds) {
  lose_link();
  ticks(limits_.link_lost_ticks - in_.link_age_ticks + 1, false);
  EXPECT_EQ(state_.mode, Mode::fault);
  EXPECT_EQ(state_.faults, bit(Fault::link_lost));
  ticks(100, true);
  EXPECT_EQ(state_.mode, Mode::fault);
  EXPECT_EQ(command(Action::clear_fault).outcome.status, Status::ok);
  ticks(100, true);
  EXPECT_EQ(state_.mode, Mode::idle);  // and is to be armed again
}

TEST_F(LinkLoss, AHostThatIsHeardButSendsNoModelLatchesToo) {
  const SupervisorState rendering = state_;
  for (const std::uint32_t heard_every_ticks : {100u, 9900u}) {
    SCOPED_TRACE(heard_every_ticks);
    state_ = rendering;
    tick(true);
    lose_link();
    for (std::uint32_t i = 1; i <= limits_.link_lost_ticks; ++i) {
      if (i % heard_every_ticks == 0) in_.link_age_ticks = 0;
      // The silence before must not decide it.
      in_.link_age_ticks = std::min(in_.link_age_ticks, heard_every_ticks);
      tick(false);
    }
    EXPECT_EQ(state_.mode, Mode::suspended);
    const SupervisorState at_the_end = state_;
    tick(true);
    EXPECT_EQ(state_.mode, Mode::fault) << "one model, too late";
    EXPECT_EQ(state_.faults, bit(Fault::link_lost));
    state_ = at_the_end;
    in_.link_age_ticks = 0;
    tick(false);
    EXPECT_EQ(state_.faults, bit(Fault::link_lost));
  }
}

TEST_F(LinkLoss, SignsOfLifeNowAndThenDoNotKeepOutputsOn) {
  in_.tip_velocity_m_s = kVelocity_m_s;
  std::uint32_t damped = 0, on = 0;
  for (; on < 60'000; ++on) {
    if (on % 350 == 349) in_.link_age_ticks = 0;
    if (!tick(false).outputs_on) break;
    if (in_.model_age_ticks < kValid_ticks + limits_.model_fade_ticks) continue;
    ASSERT_GT(norm(state_.force_N), 0.0f) << on;
    ++damped;
  }
  EXPECT_EQ(state_.mode, Mode::suspended);
  EXPECT_EQ(damped, limits_.damping_ticks);
}

TEST_F(LinkLoss, NothingButAFreshModelAndAHeardHostBringsOutputsBack) {
  lose_link();
  in_.link_age_ticks = 0;  // heard, without a model
  ticks(limits_.link_silent_ticks, false);
  EXPECT_EQ(state_.mode, Mode::suspended);
  in_.model_age_ticks = 0;  // a model, of a host that has not armed
  in_.link_age_ticks = limits_.link_silent_ticks + 1;
  ticks(50, false);
  EXPECT_EQ(state_.mode, Mode::suspended);
  in_.tip_speed_m_s = 2.0f * limits_.tip_speed_m_s;  // would refuse arming, too
  ticks(50, true);
  EXPECT_EQ(state_.mode, Mode::suspended);
  in_.tip_speed_m_s = 0.0f;
  EXPECT_EQ(command(Action::calibrate).outcome.status, Status::command_refused);
}

TEST_F(LinkLoss, AnythingElseEndsTheWait) {
  lose_link();
  const SupervisorState suspended = state_;
  EXPECT_EQ(command(Action::disarm).state.mode, Mode::idle);
  EXPECT_EQ(ticks(100, true).state.mode, Mode::idle);
  state_ = suspended;
  EXPECT_EQ(command(Action::stop).state.mode, Mode::fault);
  state_ = suspended;
  in_.emergency_stop_open = true;
  EXPECT_EQ(tick(true).state.mode, Mode::fault);
}

TEST_F(LinkLoss, ALostModelsForceIsReducedNoQuickerThanItsStep) {
  in_.force_N = {0.0f, 0.0f, 8.5f};
  ticks(100, true);
  in_.model_sequence = 0;
  largest_step_N_ = 0.0f;
  ticks(50, true);
  EXPECT_EQ(state_.force_N, Vec3f{});
  EXPECT_LE(largest_step_N_, limits_.force_step_N + kForceRounding_N);
}

// ------------------------------------------------------------------------------------------------ damping

// A tip on a line behind an encoder: what a joint sees of it.
struct DampedTip {
  static constexpr double kCount_m = 30e-6;  // 0.15 mrad over 0.2 m (shared/device/parameters.hpp)
  static constexpr double kTick_s = 1e-3;
  static constexpr int kSteps = 20;  // of the motion in a tick

  double x_m = 0.0, v_m_s = 0.0;
  std::int32_t count = 0;
  device::CountEstimator estimator{};

  // Force on the tip for the next tick.
  double force_N(const Limits& limits) {
    const auto now = static_cast<std::int32_t>(std::floor(x_m / kCount_m));
    estimator.update(static_cast<float>(now - count), 1.0f);
    count = now;
    const double velocity_m_s = static_cast<double>(estimator.velocity_count_tick()) * kCount_m / kTick_s;
    const double largest_N = static_cast<double>(limits.damping_force_N);
    return -std::clamp(static_cast<double>(limits.damping_N_s_m) * velocity_m_s, -largest_N, largest_N);
  }
};

TEST(Damping, BringsTheLightestTipToRestWithoutSwinging) {
  constexpr double kLightest_kg = 0.03;  // docs/safety.md
  const Limits limits;
  for (const double speed_m_s : {0.02, 0.1, 0.5, 1.0}) {
    DampedTip tip;
    tip.v_m_s = speed_m_s;
    double least_m_s = speed_m_s;
    for (int tick = 0; tick < 1000; ++tick) {
      const double acceleration_m_s2 = tip.force_N(limits) / kLightest_kg;
      for (int i = 0; i < DampedTip::kSteps; ++i) {
        tip.v_m_s += acceleration_m_s2 * DampedTip::kTick_s / DampedTip::kSteps;
        tip.x_m += tip.v_m_s * DampedTip::kTick_s / DampedTip::kSteps;
      }
      least_m_s = std::min(least_m_s, tip.v_m_s);
    }
    // Below a count in some ticks nothing is known of the speed: what is left is slower than a count in 20
    // ms.
    EXPECT_LT(std::fabs(tip.v_m_s), 1.5e-3) << speed_m_s;
    EXPECT_GT(least_m_s, -1.5e-3) << speed_m_s;
  }
}

// Moved by a hand to and fro it takes energy in every period, up to what a hand can do.
TEST(Damping, TakesEnergyFromAnyMotionOfAHand) {
  const Limits limits;
  for (const double frequency_Hz : {0.5, 2.0, 8.0, 20.0, 40.0}) {
    for (const double speed_m_s : {0.01, 0.1, 0.4}) {
      DampedTip tip;
      double work_J = 0.0, most_J = 0.0;
      const double rate_rad_s = 2.0 * std::numbers::pi * frequency_Hz;
      const double amplitude_m = speed_m_s / rate_rad_s;
      const int ticks = static_cast<int>(3000.0 / frequency_Hz);
      for (int tick = 0; tick < ticks; ++tick) {
        tip.x_m = amplitude_m * std::sin(rate_rad_s * tick * DampedTip::kTick_s);
        const double next_m = amplitude_m * std::sin(rate_rad_s * (tick + 1) * DampedTip::kTick_s);
        work_J += tip.force_N(limits) * (next_m - tip.x_m);
        most_J = std::max(most_J, work_J);
      }
      EXPECT_LE(work_J, 0.0) << frequency_Hz << " Hz, " << speed_m_s << " m/s";
      // Never more than its force over the counts that it takes to see that the tip has turned.
      const double turn_J = static_cast<double>(limits.damping_N_s_m) * speed_m_s *
                            (2.0 * DampedTip::kCount_m + 4.0 * speed_m_s * DampedTip::kTick_s);
      EXPECT_LE(most_J, turn_J) << frequency_Hz << " Hz, " << speed_m_s << " m/s";
    }
  }
}

// ------------------------------------------------------------------------------------------------ energy

TEST_F(LinkLoss, ASpringGivesBackWhatItTook) {
  // Pressed to peak force over 2.7 cm and let go, again and again.
  constexpr float kStiffness_N_m = 318.0f, kDepth_m = 0.0267f;
  float depth_m = 0.0f;
  for (int tick_number = 0; tick_number < 20'000; ++tick_number) {
    const float phase = static_cast<float>(tick_number % 500) / 500.0f;
    const float next_m = kDepth_m * 0.5f * (1.0f - std::cos(2.0f * std::numbers::pi_v<float> * phase));
    in_.tip_step_m = {0.0f, 0.0f, next_m - depth_m};
    depth_m = next_m;
    in_.force_N = {0.0f, 0.0f, kStiffness_N_m * depth_m};
    ASSERT_TRUE(tick(true).outputs_on) << tick_number << ": " << state_.energy_J << " J";
  }
}

TEST_F(LinkLoss, AModelThatPushesTheHandForEverIsAFault) {
  // 4 N at 0.5 m/s: 2 W.
  in_.tip_step_m = {0.0f, 0.0f, -0.5e-3f};
  std::uint32_t on = 0;
  while (tick(true).outputs_on) ASSERT_LT(++on, 5000u);
  EXPECT_EQ(state_.faults, bit(Fault::energy_created));
  EXPECT_NEAR(on, limits_.energy_J / (2.0f - limits_.energy_leak_W) * 1e3f, 2.0f);
  EXPECT_EQ(state_.force_N, Vec3f{});
}

TEST_F(LinkLoss, WhatTheHandGivesIsNoCredit) {
  in_.tip_step_m = {0.0f, 0.0f, 1e-3f};
  ticks(1000, true);  // 4 J into the body
  EXPECT_EQ(state_.energy_J, 0.0f);
}

}  // namespace
}  // namespace palpate::firmware
