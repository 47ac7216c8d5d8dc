#include "host/linearize/damping_error.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace palpate::host {
namespace {

struct System {
  Eigen::Matrix3Xd phi;
  Eigen::VectorXd lambda_rad2_s2;
  Eigen::MatrixXd damping_1_s;
};

// Modes between 10 and 3,000 rad / s, damping between light and heavy with a coupling of this size; the first
// mode grows where asked.
System random_system(unsigned seed, double coupling, bool growing) {
  constexpr Eigen::Index kModes = 12;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  System s;
  s.phi.resize(3, kModes);
  for (Eigen::Index m = 0; m < kModes; ++m)
    for (Eigen::Index axis = 0; axis < 3; ++axis) s.phi(axis, m) = 10.0 * uniform(random);
  s.lambda_rad2_s2.resize(kModes);
  Eigen::VectorXd own(kModes);
  for (Eigen::Index m = 0; m < kModes; ++m) {
    const double w = std::pow(10.0, 2.25 + 1.25 * uniform(random));
    s.lambda_rad2_s2[m] = w * w;
    own[m] = w * std::pow(10.0, 0.7 * uniform(random));
  }
  if (growing) s.lambda_rad2_s2[0] *= -0.3;
  Eigen::MatrixXd scaled = Eigen::MatrixXd::Zero(kModes, kModes);
  for (Eigen::Index a = 0; a < kModes; ++a)
    for (Eigen::Index b = 0; b < a; ++b) scaled(a, b) = scaled(b, a) = coupling * uniform(random);
  scaled.diagonal().setOnes();
  const Eigen::VectorXd root = own.cwiseSqrt();
  s.damping_1_s = root.asDiagonal() * scaled * root.asDiagonal();
  return s;
}

TEST(DampingError, IsAtMostItsBound) {
  int bounded = 0;
  double tightest = 1e9;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const System s = random_system(seed, seed % 2 == 0 ? 0.03 : 0.15, seed % 3 == 0);
    const double eta = damping_coupling_norm(s.damping_1_s);
    for (const double w : {0.6, 6.0, 30.0, 120.0, 400.0, 1500.0, 3000.0}) {
      const double bound = damping_error_bound(s.phi, s.lambda_rad2_s2, s.damping_1_s, eta, w);
      const double error = damping_error(s.phi, s.lambda_rad2_s2, s.damping_1_s, w);
      if (std::isinf(bound)) continue;
      ++bounded;
      EXPECT_LE(error, bound * (1.0 + 1e-9)) << seed << " " << w;
      tightest = std::min(tightest, bound / error);
    }
  }
  EXPECT_GT(bounded, 1000);
  EXPECT_LT(tightest, 1.5);  // it says something
}

TEST(DampingError, OfDiagonalDampingIsZero) {
  System s = random_system(1, 0.0, false);
  EXPECT_EQ(damping_coupling_norm(s.damping_1_s), 0.0);
  EXPECT_EQ(damping_error_bound(s.phi, s.lambda_rad2_s2, s.damping_1_s, 0.0, 100.0), 0.0);
  EXPECT_LT(damping_error(s.phi, s.lambda_rad2_s2, s.damping_1_s, 100.0), 1e-12);
}

TEST(DampingError, HasNoBoundWhereTheCouplingIsAllThereIs) {
  System s = random_system(2, 0.05, false);
  s.damping_1_s(3, 3) = 0.0;
  EXPECT_TRUE(std::isinf(damping_coupling_norm(s.damping_1_s)));
}

}  // namespace
}  // namespace palpate::host
