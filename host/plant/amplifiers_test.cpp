#include "host/plant/amplifiers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace palpate::plant {
namespace {

constexpr double kRounding_A = 1e-13;

TEST(Amplifiers, StepResponseIsTheFirstOrderLag) {
  const AmplifierParameters parameters{.bandwidth_Hz = 800.0, .peak_A = 5.0, .offset_A = {}};
  Amplifiers amplifiers(parameters);
  amplifiers.command({1.0, -2.0, 0.5}, true);
  // The state is advanced in unequal pieces; the closed form must not notice.
  double time_s = 0.0;
  for (const double step_s : {1e-5, 5e-5, 2e-4, 1e-3}) {
    amplifiers.advance(step_s);
    time_s += step_s;
    const double reached = 1.0 - std::exp(-2.0 * std::numbers::pi * 800.0 * time_s);
    EXPECT_NEAR(amplifiers.current_A(0.0).x, 1.0 * reached, kRounding_A);
    EXPECT_NEAR(amplifiers.current_A(0.0).y, -2.0 * reached, kRounding_A);
    EXPECT_NEAR(amplifiers.current_A(0.0).z, 0.5 * reached, kRounding_A);
  }
}

TEST(Amplifiers, SetPointsSaturate) {
  Amplifiers amplifiers(AmplifierParameters{});
  amplifiers.command({100.0, -100.0, 7.0}, true);
  amplifiers.advance(1.0);
  EXPECT_NEAR(amplifiers.current_A(0.0).x, 7.0, kRounding_A);
  EXPECT_NEAR(amplifiers.current_A(0.0).y, -7.0, kRounding_A);
}

TEST(Amplifiers, OffsetAddsToTheSetPoint) {
  Amplifiers amplifiers(
      AmplifierParameters{.bandwidth_Hz = 1000.0, .peak_A = 7.0, .offset_A = {0.02, 0.0, -0.01}});
  amplifiers.command({1.0, 0.0, 0.0}, true);
  amplifiers.advance(1.0);
  EXPECT_NEAR(amplifiers.current_A(0.0).x, 1.02, kRounding_A);
  EXPECT_NEAR(amplifiers.current_A(0.0).z, -0.01, kRounding_A);
}

TEST(Amplifiers, DisabledMeansNoCurrentAtOnce) {
  Amplifiers amplifiers(
      AmplifierParameters{.bandwidth_Hz = 1000.0, .peak_A = 7.0, .offset_A = {0.1, 0.1, 0.1}});
  EXPECT_EQ(amplifiers.current_A(0.0), Vec3d{});  // from the start
  amplifiers.command({1.0, 2.0, 3.0}, true);
  amplifiers.advance(1e-3);
  amplifiers.command({1.0, 2.0, 3.0}, false);
  EXPECT_EQ(amplifiers.current_A(0.0), Vec3d{});
  EXPECT_EQ(amplifiers.current_A(1e-3), Vec3d{});
  amplifiers.command({1.0, 2.0, 3.0}, true);  // starts from zero again
  EXPECT_NEAR(norm(amplifiers.current_A(0.0)), 0.0, kRounding_A);
}

TEST(Amplifiers, RefusesWhatIsNoCurrent) {
  Amplifiers amplifiers(AmplifierParameters{});
  EXPECT_THROW(amplifiers.command({0.0, std::numeric_limits<double>::quiet_NaN(), 0.0}, true),
               std::invalid_argument);
  EXPECT_THROW(Amplifiers(AmplifierParameters{.bandwidth_Hz = 0.0, .peak_A = 7.0, .offset_A = {}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace palpate::plant
