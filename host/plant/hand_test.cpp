#include "host/plant/hand.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace palpate::plant {
namespace {

constexpr double kRounding = 1e-12;

TEST(Hand, GripIsASpringAndDamperBetweenHandAndTip) {
  const HandParameters parameters{};
  const Hand hand(parameters);
  const HandState state{{0.001, 0.002, 0.0}, {0.0, 0.1, 0.0}};
  const Vec3d tip_m{0.0, 0.003, 0.0}, tip_m_s{0.0, 0.0, 0.2};
  const Vec3d tight_N = hand.force_N(state, tip_m, tip_m_s, 1.0);
  EXPECT_NEAR(tight_N.x, 0.001 * parameters.grip_stiffness_N_m, kRounding);
  EXPECT_NEAR(tight_N.y, -0.001 * parameters.grip_stiffness_N_m + 0.1 * parameters.grip_damping_N_s_m,
              kRounding);
  EXPECT_NEAR(tight_N.z, -0.2 * parameters.grip_damping_N_s_m, kRounding);
  EXPECT_LT(norm(hand.force_N(state, tip_m, tip_m_s, 0.25) - tight_N * 0.25), kRounding);
}

TEST(Hand, LettingGoGivesZeroForce) {
  const Hand hand(HandParameters{});
  EXPECT_EQ(hand.force_N({{0.1, 0.2, 0.3}, {1.0, 2.0, 3.0}}, {}, {}, 0.0), Vec3d{});
}

TEST(Hand, FollowsThePathWithItsImpedance) {
  const HandParameters parameters{};
  const Hand hand(parameters);
  const PathPoint intended{{0.01, 0.0, 0.0}, {0.0, 0.5, 0.0}};
  const Vec3d acceleration_m_s2 = hand.acceleration_m_s2({}, intended, {0.0, 0.0, 2.0});
  EXPECT_NEAR(acceleration_m_s2.x * parameters.mass_kg, 0.01 * parameters.stiffness_N_m, kRounding);
  EXPECT_NEAR(acceleration_m_s2.y * parameters.mass_kg, 0.5 * parameters.damping_N_s_m, kRounding);
  EXPECT_NEAR(acceleration_m_s2.z * parameters.mass_kg, -2.0, kRounding);
}

TEST(Hand, RefusesParametersOutOfRange) {
  EXPECT_THROW(Hand(HandParameters{.mass_kg = 0.0}), std::invalid_argument);
  EXPECT_THROW(Hand(HandParameters{.stiffness_N_m = -1.0}), std::invalid_argument);
  EXPECT_THROW(Hand(HandParameters{.grip_damping_N_s_m = std::numeric_limits<double>::quiet_NaN()}),
               std::invalid_argument);
}

}  // namespace
}  // namespace palpate::plant
