#include "host/bench/virtual_wall.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace palpate::host::bench {
namespace {

constexpr double kMost_J = 1e-3;
constexpr WallDevice kNoFriction{
    .mass_kg = 0.05, .viscosity_N_s_m = 0.0, .friction_N = 0.0, .most_force_N = 1e3};

// A hold is half a tick late: K T / 2 of negative damping, to first order in T sqrt(K / m). In the wall the
// mass swings about F / K, from phase -phi on its way in to pi + phi on its way out: (K T / 2) times the
// integral of v^2.
TEST(VirtualWall, OneBounceCreatesWhatTheHoldIsLate) {
  constexpr double kStiffness_N_m = 500.0, kPush_N = 1.0, kWay_m = 5e-3;
  const double omega_rad_s = std::sqrt(kStiffness_N_m / kNoFriction.mass_kg);
  const double speed_m_s = std::sqrt(2.0 * kPush_N * kWay_m / kNoFriction.mass_kg);
  const double rest_m = kPush_N / kStiffness_N_m;
  const double swing_m = std::hypot(rest_m, speed_m_s / omega_rad_s);
  const double phi = std::asin(rest_m / swing_m);
  const double integral =
      swing_m * swing_m * omega_rad_s * 0.5 * (std::numbers::pi + 2.0 * phi + std::sin(2.0 * phi));
  // 22 ms to the wall, 38 in it, 22 back; what was created lifts the mass beyond its start.
  constexpr double kDuration_s = 0.1;
  for (const double rate_Hz : {4000.0, 8000.0, 16'000.0}) {
    const double expected_J = 0.5 * kStiffness_N_m / rate_Hz * integral;
    const double created_J =
        created_energy_J(kNoFriction, {.push_N = kPush_N}, {.rate_Hz = rate_Hz, .count_m = 0.0},
                         {kStiffness_N_m, 0.0}, kDuration_s, 1.0);
    EXPECT_NEAR(created_J, expected_J, 0.1 * expected_J) << rate_Hz;
  }
}

TEST(VirtualWall, WithinColgatesBoundNothingIsCreated) {
  // b > K T / 2 + |B|, of the device itself.
  const WallDevice device{.mass_kg = 0.05, .viscosity_N_s_m = 0.5, .friction_N = 0.0};
  for (const double damping_N_s_m : {0.0, 0.2, 0.4}) {
    const double bound_N_m = 2.0 * 1000.0 * (device.viscosity_N_s_m - damping_N_s_m);
    for (const WallHand& hand : wall_hands()) {
      const double created_J =
          created_energy_J(device, hand, {.count_m = 0.0}, {0.95 * bound_N_m, damping_N_s_m}, 2.0, kMost_J);
      EXPECT_LT(created_J, 1e-9) << damping_N_s_m << ' ' << hand.mass_kg;
    }
  }
}

TEST(VirtualWall, TheControllerHoldsWhatItCreates) {
  const Wall wall{2000.0, 0.0};
  const WallHand& light = wall_hands().front();
  EXPECT_GT(created_energy_J({}, light, {}, wall, 3.0, kMost_J), kMost_J);
  EXPECT_LT(created_energy_J({}, light, {.is_controlled = true}, wall, 3.0, kMost_J), kMost_J);
}

TEST(VirtualWall, IsTheStifferTheFasterAndTheLessLate) {
  const auto stiffest = [](double rate_Hz, std::uint32_t delay_ticks) {
    return stiffest_wall_N_m({}, {.rate_Hz = rate_Hz, .delay_ticks = delay_ticks}, 0.0, 1.0, kMost_J)
        .value_or(0.0);
  };
  EXPECT_GT(stiffest(2000.0, 0), stiffest(1000.0, 0));
  EXPECT_GT(stiffest(1000.0, 0), stiffest(1000.0, 2));
  EXPECT_GT(stiffest(1000.0, 2), 0.0);
}

TEST(VirtualWall, RefusesWhatIsOutOfRange) {
  EXPECT_THROW((void)created_energy_J({}, {}, {.rate_Hz = 1.0}, {}, 1.0, 1.0), std::invalid_argument);
  EXPECT_THROW((void)created_energy_J({}, {}, {.delay_ticks = 65}, {}, 1.0, 1.0), std::invalid_argument);
  EXPECT_THROW((void)created_energy_J({}, {}, {.count_m = -1.0}, {}, 1.0, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host::bench
