#include "host/linearize/modal_coefficients.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

namespace palpate::host {
namespace {

constexpr double kStep_s = 1e-3;

std::array<double, 6> entries(const ModalCoefficients& c) {
  return {c.a11, c.a12, c.a21, c.a22, c.b1, c.b2};
}

bool resolved(double lambda, double damping) {
  return lambda - 0.25 * damping * damping <= std::pow(kLargestResolvedPhase_rad / kStep_s, 2);
}

std::vector<double> lambdas() {
  std::vector<double> all{0.0};
  for (int half_decade = -6; half_decade <= 14; ++half_decade) {
    const double magnitude = std::pow(10.0, 0.5 * half_decade);
    all.push_back(magnitude);
    all.push_back(-magnitude);
  }
  return all;
}

constexpr std::array<double, 10> kDampings{0.0, -1e-6, 1e-3, 1.0, 30.0, 400.0, 2e3, 7.75e3, 4e4, 1e6};

// exp(G h) - I of the augmented system, entry by entry.
std::array<double, 6> augmented_exponential(double lambda, double damping) {
  Eigen::Matrix3d generator;
  generator << 0, 1, 0, -lambda, -damping, 1, 0, 0, 0;
  const Eigen::Matrix3d scaled = generator * kStep_s;
  const Eigen::Matrix3d e = scaled.exp() - Eigen::Matrix3d::Identity();
  return {e(0, 0), e(0, 1), e(1, 0), e(1, 1), e(0, 2), e(1, 2)};
}

TEST(ModalCoefficients, AreTheMatrixExponential) {
  for (const double lambda : lambdas()) {
    for (const double damping : kDampings) {
      if (!resolved(lambda, damping)) continue;
      const auto mine = entries(modal_coefficients(lambda, damping, kStep_s));
      const auto exact = augmented_exponential(lambda, damping);
      // Both lose some digits in up to 12 squarings, Eigen's also those of entries far below the matrix norm.
      const double scale = std::max({1.0, std::abs(lambda) * kStep_s, damping});
      const std::array<double, 6> size{scale, kStep_s * scale, scale / kStep_s,
                                       scale, kStep_s * scale, kStep_s * scale};
      for (std::size_t e = 0; e < 6; ++e)
        EXPECT_NEAR(mine[e], exact[e], 1e-12 * size[e])
            << "lambda " << lambda << " d " << damping << " entry " << e;
    }
  }
}

// The Taylor series in long double; where the argument is below 1 nothing cancels, so every entry keeps its
// digits.
TEST(ModalCoefficients, KeepTheirDigitsForSlowModes) {
  constexpr double kDigits = 2e-15;
  for (const double lambda : lambdas()) {
    for (const double damping : {0.0, 1e-3, 1.0, 30.0, 400.0}) {
      if (std::abs(lambda) * kStep_s * kStep_s > 0.5) continue;
      using Matrix3l = Eigen::Matrix<long double, 3, 3>;
      Matrix3l g;
      const long double h = kStep_s;
      g << 0, h, 0, -h * static_cast<long double>(lambda), -h * static_cast<long double>(damping), h, 0, 0, 0;
      Matrix3l term = g;
      Matrix3l sum = g;
      for (int k = 2; k < 40; ++k) {
        term = (term * g / k).eval();
        sum += term;
      }
      const std::array<long double, 6> exact{sum(0, 0), sum(0, 1), sum(1, 0),
                                             sum(1, 1), sum(0, 2), sum(1, 2)};
      const auto mine = entries(modal_coefficients(lambda, damping, kStep_s));
      for (std::size_t e = 0; e < 6; ++e) {
        const auto reference = static_cast<double>(exact[e]);
        EXPECT_NEAR(mine[e], reference, kDigits * std::abs(reference))
            << "lambda " << lambda << " d " << damping << " entry " << e;
      }
    }
  }
}

TEST(ModalCoefficients, UnresolvedOscillationIsBackwardEuler) {
  const double lambda = std::pow(2.0 / kStep_s, 2) * 10;
  for (const double damping : {0.0, 10.0, 1000.0}) {
    ASSERT_FALSE(resolved(lambda, damping));
    Eigen::Matrix2d generator;
    generator << 0, 1, -lambda, -damping;
    const Eigen::Matrix2d a = (Eigen::Matrix2d::Identity() - kStep_s * generator).inverse();
    const Eigen::Vector2d b = a * Eigen::Vector2d(0, kStep_s);
    const ModalCoefficients c = modal_coefficients(lambda, damping, kStep_s);
    EXPECT_NEAR(c.a11, a(0, 0) - 1, 1e-14);
    EXPECT_NEAR(c.a12, a(0, 1), 1e-14 * kStep_s);
    EXPECT_NEAR(c.a21, a(1, 0), 1e-14 / kStep_s);
    EXPECT_NEAR(c.a22, a(1, 1) - 1, 1e-14);
    EXPECT_NEAR(c.b1, b[0], 1e-14 * b[0]);
    EXPECT_NEAR(c.b2, b[1], 1e-14 * b[1]);
  }
}

TEST(ModalCoefficients, StaticResponseIsOneOverLambda) {
  for (const double lambda : {1.0, 1e3, 1e6, 1e8, 1e12}) {
    for (const double damping : kDampings) {
      const ModalCoefficients c = modal_coefficients(lambda, damping, kStep_s);
      // At q = 1 / lambda, p = 0, u = 1 nothing changes.
      EXPECT_NEAR(c.a11 / lambda + c.b1, 0.0, 1e-13 * c.b1) << lambda << " " << damping;
      EXPECT_NEAR(c.a21 / lambda + c.b2, 0.0, 1e-13 * c.b2 + 1e-25) << lambda << " " << damping;
    }
  }
}

TEST(ModalCoefficients, PositiveLambdaNeverGrows) {
  for (const double lambda : {1e-3, 1.0, 1e4, 1e6, 6e6, 1e7, 1e9, 1e14}) {
    for (const double damping : {0.0, 1.0, 1e3, 1e6}) {
      const ModalCoefficients c = modal_coefficients(lambda, damping, kStep_s);
      Eigen::Matrix2d a;
      a << 1 + c.a11, c.a12, c.a21, 1 + c.a22;
      EXPECT_LE(a.eigenvalues().cwiseAbs().maxCoeff(), 1.0 + 1e-12) << lambda << " " << damping;
    }
  }
}

// What the limit on the phase is for: a force held for one step always finds compliance, however stiff the
// mode.
TEST(ModalCoefficients, ComplianceWithinAStepNeverVanishes) {
  for (int i = 0; i < 500; ++i) {
    const double phase = std::pow(1.01, i);
    const double lambda = std::pow(phase / kStep_s, 2);
    const ModalCoefficients c = modal_coefficients(lambda, 0.0, kStep_s);
    EXPECT_GT(c.b1 * lambda, 0.45) << phase;  // 1 - cos(1) = 0.46
    EXPECT_LT(c.b1 * lambda, 1.81) << phase;  // 1 - cos(2.5) = 1.80
  }
}

// The zero of the sampled response to a held force (the pole of its inverse) stays in the unit circle.
TEST(ModalCoefficients, SampledZeroStaysInTheUnitCircle) {
  for (const double lambda : {1e-3, 1.0, 1e4, 1e6, 6e6, 1e7, 1e9}) {
    for (const double damping : {0.0, 1.0, 1e3, 1e4, 1e6}) {
      const ModalCoefficients c = modal_coefficients(lambda, damping, kStep_s);
      const double zero = 1 + c.a22 - c.a12 * c.b2 / c.b1;
      EXPECT_LE(std::abs(zero), 1.0 + 1e-9) << lambda << " " << damping;
    }
  }
}

TEST(ModalCoefficients, RefusesWhatHasNoSteps) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(modal_coefficients(kNaN, 0, kStep_s), std::invalid_argument);
  EXPECT_THROW(modal_coefficients(1, std::numeric_limits<double>::infinity(), kStep_s),
               std::invalid_argument);
  EXPECT_THROW(modal_coefficients(1, 0, 0), std::invalid_argument);
  EXPECT_THROW(modal_coefficients(1, 0, kNaN), std::invalid_argument);
  EXPECT_THROW(modal_coefficients(-1e14, 0, kStep_s), std::invalid_argument);  // e^10000
}

}  // namespace
}  // namespace palpate::host
