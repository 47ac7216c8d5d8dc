#include "shared/math/trig.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// One unit in the last place of 1.0f is 1.19e-7; the documented bound of sin_cos.
constexpr double kSinCosError = 1.2e-7;

TEST(Trig, AgreesWithDoublePrecisionOverTheRange) {
  double worst = 0.0;
  constexpr int kSamples = 2'000'001;
  for (int i = 0; i < kSamples; ++i) {
    const auto angle = static_cast<float>(-100.0 + 200.0 * i / (kSamples - 1));
    const SinCos value = sin_cos(angle);
    worst = std::max({worst, std::abs(static_cast<double>(value.sine) - std::sin(static_cast<double>(angle))),
                      std::abs(static_cast<double>(value.cosine) - std::cos(static_cast<double>(angle)))});
  }
  EXPECT_LE(worst, kSinCosError);
}

TEST(Trig, OutOfRangeIsNan) {
  EXPECT_TRUE(std::isnan(sin_cos(100.1f).sine));
  EXPECT_TRUE(std::isnan(sin_cos(-1e9f).cosine));
  EXPECT_TRUE(std::isnan(sin_cos(NAN).sine));
}

}  // namespace
}  // namespace palpate
