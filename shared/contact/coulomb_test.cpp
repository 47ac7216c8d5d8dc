#include "shared/contact/coulomb.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

constexpr double kRounding = 1e-9;  // relative; solves of well-conditioned 3x3 systems in double

class Coulomb : public ::testing::Test {
 protected:
  std::mt19937 random_{5};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};

  Vec3d vector() { return {uniform_(random_), uniform_(random_), uniform_(random_)}; }
  // Symmetric positive definite with condition number up to about ten.
  Mat3d compliance() {
    Mat3d c = Mat3d::identity(1e-3);
    for (int i = 0; i < 3; ++i) {
      const Vec3d v = vector();
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t k = 0; k < 3; ++k) c(r, k) += 1e-3 * v[r] * v[k];
    }
    return c;
  }
};

TEST_F(Coulomb, StickClosesTheGapSlipKeepsTheConeFreeNeverPulls) {
  int seen[3] = {};
  for (int trial = 0; trial < 20000; ++trial) {
    const Mat3d c = compliance();
    const Vec3d normal = normalized(vector());
    const Vec3d gap = vector() * 1e-3;
    const double mu = 0.5 * (1.0 + uniform_(random_));
    const auto previous = trial % 2 == 0 ? ContactMode::stick : ContactMode::slip;
    const auto result = solve_coulomb(gap, c, normal, {mu, mu}, previous);
    ++seen[static_cast<int>(result.mode)];
    const double fn = -dot(normal, result.force_N);
    const double ft = norm(result.force_N + normal * fn);
    if (result.mode == ContactMode::free) {
      EXPECT_EQ(result.force_N, Vec3d{});
      continue;
    }
    EXPECT_GT(fn, 0.0);
    const Vec3d left = gap - c * result.force_N;
    if (result.mode == ContactMode::stick) {
      EXPECT_LT(norm(left), kRounding);
    } else {
      EXPECT_NEAR(ft, mu * fn, kRounding * fn);
      EXPECT_NEAR(dot(normal, left), 0.0, kRounding * 1e-3);
      // Friction works against the slip of the body under the tip: the tip drags the surface along.
      EXPECT_GE(dot(left, result.force_N + normal * fn), -1e-9);
    }
  }
  for (int count : seen) EXPECT_GT(count, 100);
}

TEST_F(Coulomb, ForceWithoutFrictionIsAlongTheNormal) {
  for (int trial = 0; trial < 1000; ++trial) {
    const Vec3d normal = normalized(vector());
    const auto result = solve_coulomb(vector() * 1e-3, compliance(), normal, {0.0, 0.0}, ContactMode::slip);
    EXPECT_LT(norm(cross(result.force_N, normal)), 1e-12 * (1.0 + norm(result.force_N)));
  }
}

TEST_F(Coulomb, DirectionOfSlipIsThatOfTheFriction) {
  // Mildly anisotropic compliance, as of a homogeneous body: the iteration has converged.
  Mat3d c = Mat3d::identity(1e-3);
  c(0, 0) = 1.4e-3;
  const Vec3d normal{0, 0, 1};
  const auto result = solve_coulomb(Vec3d{2e-3, 1e-3, -0.5e-3}, c, normal, {0.5, 0.5}, ContactMode::slip);
  ASSERT_EQ(result.mode, ContactMode::slip);
  const Vec3d left = Vec3d{2e-3, 1e-3, -0.5e-3} - c * result.force_N;
  const Vec3d slip = normalized(Vec3d{left.x, left.y, 0});
  const Vec3d friction = normalized(Vec3d{result.force_N.x, result.force_N.y, 0});
  EXPECT_LT(norm(slip - friction), 2e-3);
}

TEST_F(Coulomb, StaticFrictionHoldsLongerThanKinetic) {
  const Mat3d c = Mat3d::identity(1e-3);
  const Vec3d gap{0.7e-3, 0, -1e-3};  // ratio of tangential to normal force 0.7
  const Friction<double> friction{0.8, 0.5};
  EXPECT_EQ(solve_coulomb(gap, c, Vec3d{0, 0, 1}, friction, ContactMode::stick).mode, ContactMode::stick);
  EXPECT_EQ(solve_coulomb(gap, c, Vec3d{0, 0, 1}, friction, ContactMode::slip).mode, ContactMode::slip);
}

// C_nn - mu C_nt.d < 0: friction along d presses the surface up faster than it yields. Such a contact could
// press without end, and could as well not touch: there is no force.
TEST_F(Coulomb, AWedgedContactThatNeedNotTouchIsFree) {
  const Mat3d c{{{2e-3, 0, 1.2e-3}, {0, 1e-3, 0}, {1.2e-3, 0, 1e-3}}};
  const Vec3d normal{0, 0, 1};
  const Vec3d force{1.2, 0, -0.5};  // sticking would break the cone: ratio 2.4 > mu
  ASSERT_GT(dot(normal, c * force), 0.0);
  const auto result = solve_coulomb(c * force, c, normal, {1.0, 1.0}, ContactMode::stick);
  EXPECT_EQ(result.mode, ContactMode::free);
  EXPECT_EQ(norm(result.force_N), 0.0);
}

// Compliances that couple a soft direction with stiff ones, 50 to 1 and more, wedged ones among them: the
// solution presses, closes the normal gap, keeps the cone, and its friction goes along the slip; where the
// tip is behind the surface there always is one.
TEST_F(Coulomb, StronglyCoupledCompliancesHaveASolutionByCoulombsLaw) {
  // 2.6 degrees: what the iteration is held to (kSlipConverged).
  constexpr double kAligned = 0.999;
  int wedged = 0, slipping = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    Mat3d c = Mat3d::identity(2e-5);
    const Vec3d soft = vector();
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < 3; ++k) c(r, k) += 1e-3 * soft[r] * soft[k];
    const Vec3d normal = normalized(vector()), gap = vector() * 1e-3;
    const Friction<double> friction{1.5, 1.0};
    const auto previous = trial % 2 == 0 ? ContactMode::stick : ContactMode::slip;
    const double mu =
        previous == ContactMode::slip ? friction.kinetic_coefficient : friction.static_coefficient;
    const auto result = solve_coulomb(gap, c, normal, friction, previous);
    ASSERT_TRUE(dot(normal, gap) >= 0 || result.mode != ContactMode::free);
    if (result.mode == ContactMode::free) {
      Vec3d stick{};
      ASSERT_TRUE(solve(c, gap, stick));
      if (dot(normal, stick) < 0) ++wedged;  // sticking presses, beyond the cone
      continue;
    }
    ASSERT_TRUE(is_finite(result.force_N));
    const double fn = -dot(normal, result.force_N);
    const Vec3d friction_N = result.force_N + normal * fn, slip = gap - c * result.force_N;
    ASSERT_GE(fn, 0.0);
    ASSERT_NEAR(dot(normal, slip), 0.0, 1e-6 * norm(gap));
    if (result.mode == ContactMode::stick) {
      ASSERT_LE(norm(friction_N), mu * fn * (1.0 + kRounding));
      continue;
    }
    ++slipping;
    ASSERT_NEAR(norm(friction_N), friction.kinetic_coefficient * fn, kRounding * fn);
    const Vec3d slip_t = slip - normal * dot(normal, slip);
    ASSERT_GE(dot(slip_t, friction_N), kAligned * norm(slip_t) * norm(friction_N));
  }
  EXPECT_GT(wedged, 20);
  EXPECT_GT(slipping, 1000);
}

TEST_F(Coulomb, SingularComplianceGivesNoForce) {
  EXPECT_EQ(solve_coulomb(Vec3d{0, 0, -1}, Mat3d{}, Vec3d{0, 0, 1}, {1.0, 1.0}, ContactMode::stick).mode,
            ContactMode::free);
}

}  // namespace
}  // namespace palpate
