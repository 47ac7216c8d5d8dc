#include "shared/device/count_estimator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace palpate::device {
namespace {

// The bounds that count_estimator.hpp derives.
constexpr double kAlways_count = 2.5, kAtRest_count = 1.0;
constexpr double kTick_s = 1e-3;
constexpr double kRounding = 1e-6;  // float32 of a count

// An encoder, and the estimate behind it.
class Joint {
 public:
  // One tick, at the end of which the joint is at this position, in counts.
  void at(double position_count, double elapsed_ticks = 1.0) {
    const double count = std::floor(position_count + 0.5);
    if (started_) estimator_.update(static_cast<float>(count - count_), static_cast<float>(elapsed_ticks));
    started_ = true;
    count_ = count;
    error_count = position_count - estimate();
  }
  double estimate() const { return count_ + static_cast<double>(estimator_.offset_count()); }
  double velocity() const { return static_cast<double>(estimator_.velocity_count_tick()); }
  double count() const { return count_; }

  double error_count = 0.0;

 private:
  CountEstimator estimator_{};
  double count_ = 0.0;
  bool started_ = false;
};

TEST(CountEstimator, RestsOnTheCount) {
  Joint joint;
  for (int i = 0; i < 100; ++i) joint.at(7.3);
  EXPECT_EQ(joint.estimate(), 7.0);
  EXPECT_EQ(joint.velocity(), 0.0);
}

// A joint at rest on the border of two intervals, its count toggling at random: after the first change the
// estimate comes to rest, in the middle between both counts.
TEST(CountEstimator, ATogglingCountDoesNotMoveIt) {
  constexpr double kStill_count = 1e-3;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> tremor(-0.2, 0.2);
  Joint joint;
  for (int i = 0; i < 300; ++i) joint.at(10.5 + tremor(random));
  const double held = joint.estimate();
  EXPECT_NEAR(held, 10.5, 1e-3);
  for (int i = 0; i < 1000; ++i) {
    joint.at(10.5 + tremor(random));
    ASSERT_NEAR(joint.estimate(), held, kStill_count);
  }
}

// After one count the estimate goes there without a jump: at most 1/32 of what is missing per tick, and half
// a count is missing at most where it had rested on the count, one where it had rested on the interval's far
// end.
TEST(CountEstimator, ACountAfterALongRestDoesNotClick) {
  Joint joint;
  for (int i = 0; i < 200; ++i) joint.at(0.0);
  double before = joint.estimate();
  for (const double position : {0.6, 1.6, 2.6}) {
    for (int i = 0; i < 500; ++i) {
      joint.at(position);
      EXPECT_LE(std::abs(joint.estimate() - before), 1.0 / 32.0 + kRounding) << position << " " << i;
      before = joint.estimate();
    }
    EXPECT_LE(std::abs(joint.error_count), kAtRest_count);
  }
}

// (At exactly one count a tick every place within the interval gives the same counts: only the bounds hold.)
TEST(CountEstimator, OnARampItIsWithinItsBoundsAndLearnsTheVelocity) {
  for (const double velocity : {0.01, 0.03, 0.1, 0.37, 0.96, 2.6, 17.3, -0.2, -3.3}) {
    Joint joint;
    for (int i = 0; i < 50; ++i) joint.at(0.2);
    const double interval_ticks = std::max(1.0, 1.0 / std::abs(velocity));
    const int settling = static_cast<int>(12.0 * interval_ticks) + 30;
    double worst = 0.0, sum = 0.0;
    const int ticks = settling + static_cast<int>(20.0 * interval_ticks) + 200;
    for (int i = 1; i <= ticks; ++i) {
      joint.at(0.2 + velocity * i);
      worst = std::max(worst, std::abs(joint.error_count));
      if (i <= settling) continue;
      // No better than one count over the time that it takes.
      EXPECT_LE(std::abs(joint.velocity() - velocity), 1.0 / interval_ticks) << velocity << " " << i;
      sum += joint.error_count;
    }
    const double count = ticks - settling;
    EXPECT_LE(worst, kAlways_count) << velocity;
    // Centred: what it lags behind on the average is below half a count.
    EXPECT_LE(std::abs(sum / count), 0.5) << velocity;
  }
}

// 2 mm at 1 and 3 Hz, 1 mm at 10 Hz, with counts of 0.03 mm: the bound always holds, and the estimate is late
// by less than half a tick, its amplitude right within 2 %.
TEST(CountEstimator, FollowsSinesWithoutDelay) {
  constexpr double kDelay_s = 0.5e-3, kAmplitude = 0.02;
  struct Sine {
    double frequency_Hz, amplitude_count;
  };
  for (const Sine sine : {Sine{1.0, 66.0}, Sine{3.0, 66.0}, Sine{10.0, 33.0}}) {
    Joint joint;
    const double omega = 2.0 * std::numbers::pi * sine.frequency_Hz;
    double in_phase = 0.0, quadrature = 0.0;
    constexpr int kTicks = 4000;
    for (int i = 0; i < kTicks; ++i) {
      const double phase = omega * i * kTick_s;
      joint.at(sine.amplitude_count * std::sin(phase));
      EXPECT_LE(std::abs(joint.error_count), kAlways_count);
      in_phase += joint.estimate() * std::sin(phase) * 2.0 / kTicks;
      quadrature += joint.estimate() * std::cos(phase) * 2.0 / kTicks;
    }
    EXPECT_LE(std::abs(std::atan2(quadrature, in_phase)) / omega, kDelay_s) << sine.frequency_Hz;
    EXPECT_NEAR(std::hypot(in_phase, quadrature) / sine.amplitude_count, 1.0, kAmplitude)
        << sine.frequency_Hz;
  }
}

TEST(CountEstimator, ARandomWalkNeverLeavesTheBound) {
  std::mt19937 random(5);
  std::normal_distribution<double> kick(0.0, 0.05);
  std::uniform_int_distribution<int> lost(0, 50);
  Joint joint;
  double position = 0.0, velocity = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const int elapsed = lost(random) == 0 ? 3 : 1;
    velocity = 0.99 * velocity + kick(random);
    position += velocity * elapsed;
    joint.at(position, elapsed);
    ASSERT_LE(std::abs(joint.error_count), kAlways_count);
  }
}

TEST(CountEstimator, AnImpossibleStepStartsItAnew) {
  Joint joint;
  for (int i = 0; i < 100; ++i) joint.at(0.4 * i);
  EXPECT_NE(joint.velocity(), 0.0);
  joint.at(1e6);
  EXPECT_EQ(joint.estimate(), joint.count());
  EXPECT_EQ(joint.velocity(), 0.0);
}

}  // namespace
}  // namespace palpate::device
