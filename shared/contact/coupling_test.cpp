#include "shared/contact/coupling.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace palpate {
namespace {

constexpr double kStep_s = 1e-3;
constexpr double kRounding = 1e-12;

TEST(Coupling, WithoutStiffnessItDoesNotYield) {
  const CouplingStep<double> rigid({0.0, 5.0}, kStep_s);
  EXPECT_FALSE(rigid.yields());
  EXPECT_EQ(rigid.compliance_m_N, 0.0);
  EXPECT_EQ(rigid.memory, 0.0);
}

TEST(Coupling, AConstantForceStretchesItByForceOverStiffness) {
  const CouplingStep<double> coupling({800.0, 2.0}, kStep_s);
  const Vec3d force{0.3, -0.2, 1.0};
  Vec3d stretch{};
  for (int i = 0; i < 100; ++i) stretch = coupling.stretch_m(stretch, force);
  EXPECT_LE(norm(stretch - force * (1.0 / 800.0)), kRounding);
}

TEST(Coupling, FollowsBackwardEulerOfASpringAndADamper) {
  constexpr double kStiffness = 1500.0, kDamping = 0.7;
  const CouplingStep<double> coupling({kStiffness, kDamping}, kStep_s);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> force(-2.0, 2.0);
  Vec3d before{};
  for (int i = 0; i < 200; ++i) {
    const Vec3d f{force(random), force(random), force(random)};
    const Vec3d after = coupling.stretch_m(before, f);
    EXPECT_LE(norm(after * kStiffness + (after - before) * (kDamping / kStep_s) - f), kRounding);
    before = after;
  }
}

// In any step the work put in is at least the gain of K s^2 / 2: no sequence of forces takes more out of it
// than was put in.
TEST(Coupling, TakesUpEnergyInEveryStep) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> force(-2.0, 2.0), exponent(-1.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const double stiffness = 1000.0 * std::pow(10.0, 2.0 * exponent(random));
    const double damping = std::pow(10.0, exponent(random));
    const CouplingStep<double> coupling({stiffness, damping}, kStep_s);
    Vec3d before{};
    for (int i = 0; i < 50; ++i) {
      const Vec3d f{force(random), force(random), force(random)};
      const Vec3d after = coupling.stretch_m(before, f);
      const double work = dot(f, after - before);
      const double gain = 0.5 * stiffness * (dot(after, after) - dot(before, before));
      const double damped = damping / kStep_s * dot(after - before, after - before);
      EXPECT_GE(work - gain, damped - kRounding);
      before = after;
    }
  }
}

TEST(Coupling, TheStiffestYieldsLeast) {
  double last = 1.0;
  for (double stiffness = 10.0; stiffness < 1e9; stiffness *= 10.0) {
    const CouplingStep<double> coupling({stiffness, 0.0}, kStep_s);
    EXPECT_LT(coupling.compliance_m_N, last);
    EXPECT_EQ(coupling.memory, 0.0);
    last = coupling.compliance_m_N;
  }
}

}  // namespace
}  // namespace palpate
