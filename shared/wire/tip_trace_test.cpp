#include "shared/wire/tip_trace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace palpate::wire {
namespace {

using Path = std::vector<Vec3f>;

// Largest distance of a coordinate from where it was, and the largest offset, m.
struct Difference {
  double error_m = 0, offset_m = 0;
};
Difference compare(const Path& path, const palpate_TipTrace_1_0& message) {
  Difference difference;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vec3d tip_m = read_tip(message, i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto true_m = static_cast<double>(path[i][axis]);
      difference.error_m = std::max(difference.error_m, std::fabs(tip_m[axis] - true_m));
      difference.offset_m =
          std::max(difference.offset_m, std::fabs(true_m - static_cast<double>(path[0][axis])));
    }
  }
  return difference;
}

void expect_bound(const Path& path) {
  palpate_TipTrace_1_0 message{};
  ASSERT_EQ(write_tips(path, message), Status::ok);
  ASSERT_EQ(check_tips(message), Status::ok);
  ASSERT_EQ(message.offsets.count, path.size() - 1);
  const Vec3d first_m = read_tip(message, 0);
  EXPECT_EQ(static_cast<float>(first_m.x), path[0].x);
  const double step_m = std::ldexp(1.0, message.step_exponent);
  const Difference difference = compare(path, message);
  EXPECT_LT(difference.error_m, kTipError_steps * step_m);
  // The least exponent that will do.
  EXPECT_LE(step_m, std::max(difference.offset_m / 16383.0, std::ldexp(1.0, -36)));
}

// Paths of all lengths and speeds, anywhere in 1 m, through the axes' zeros, too.
TEST(TipTrace, EveryCoordinateIsWithinItsBound) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> place_m(-0.5f, 0.5f), decade(-12.0f, -0.3f), part(-1.0f, 1.0f);
  for (int trial = 0; trial < 20'000; ++trial) {
    const float size_m = std::pow(10.0f, decade(random));
    const bool at_zero = trial % 4 == 0;
    const Vec3f centre_m = at_zero ? Vec3f{} : Vec3f{place_m(random), place_m(random), place_m(random)};
    Path path(1 + random() % kMaxTraceTicks);
    for (Vec3f& tip_m : path)
      tip_m = centre_m + Vec3f{size_m * part(random), size_m * part(random), size_m * part(random)};
    expect_bound(path);
  }
}

// Largest offsets just below and above those at which the exponent changes.
TEST(TipTrace, NothingOverflowsWhereTheExponentChanges) {
  for (int exponent = -36; exponent < -12; ++exponent) {
    const float end_m = std::ldexp(32767.5f, exponent);
    for (const float offset_m : {std::nextafter(end_m, 0.0f), end_m, std::nextafter(end_m, 1e9f),
                                 -std::nextafter(end_m, 0.0f), -end_m}) {
      const Path path{{0, 0, 0}, {offset_m, 0.25f * offset_m, -0.5f * offset_m}};
      expect_bound(path);
      palpate_TipTrace_1_0 message{};
      ASSERT_EQ(write_tips(path, message), Status::ok);
      EXPECT_EQ(message.step_exponent, std::fabs(offset_m) < end_m ? exponent : exponent + 1);
      EXPECT_GT(std::abs(int{message.offsets.elements[0].steps[0]}), 16383);
    }
  }
}

TEST(TipTrace, RestAndTheSingleTickAreExact) {
  palpate_TipTrace_1_0 message{};
  const Path rest(kMaxTraceTicks, {0.1f, -0.2f, 0.3f});
  ASSERT_EQ(write_tips(rest, message), Status::ok);
  EXPECT_EQ(compare(rest, message).error_m, 0.0);
  ASSERT_EQ(write_tips(Path{{0.1f, -0.2f, 0.3f}}, message), Status::ok);
  EXPECT_EQ(message.offsets.count, 0u);
  EXPECT_EQ(read_tip(message, 0).z, static_cast<double>(0.3f));
}

// What docs/protocol.md says of a tip at 0.5 m/s.
TEST(TipTrace, ErrorAtHalfAMetreASecond) {
  for (const auto& [ticks, error_m] : {std::pair{4, 46e-9}, std::pair{8, 107.3e-9}}) {
    Path path;
    for (int i = 0; i < ticks; ++i) path.push_back({0.1f + 5e-4f * static_cast<float>(i), 0.2f, 0.0f});
    palpate_TipTrace_1_0 message{};
    ASSERT_EQ(write_tips(path, message), Status::ok);
    EXPECT_LT(compare(path, message).error_m, error_m) << ticks;
    EXPECT_LT(kTipError_steps * std::ldexp(1.0, message.step_exponent), error_m) << ticks;
  }
}

TEST(TipTrace, WhatItCannotSayIsNotWritten) {
  palpate_TipTrace_1_0 message{};
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(),
                  kInf = std::numeric_limits<float>::infinity();
  for (const float bad : {kNaN, kInf, -kInf, 9.0f}) {
    EXPECT_EQ(write_tips(Path{{0, 0, 0}, {0, bad, 0}}, message), Status::payload_malformed) << bad;
    EXPECT_EQ(write_tips(Path{{0, 0, 0}, {0, 0, 0}, {0, 0, bad}}, message), Status::payload_malformed) << bad;
  }
  for (const float bad : {kNaN, kInf})
    EXPECT_EQ(write_tips(Path{{0, bad, 0}}, message), Status::payload_malformed) << bad;
}

TEST(TipTrace, WhatNoBoardSendsIsNotRead) {
  palpate_TipTrace_1_0 good{};
  ASSERT_EQ(write_tips(Path{{0, 0, 0}, {1e-3f, 0, 0}}, good), Status::ok);
  for (const int exponent : {-128, -37, -11, 0, 127}) {
    palpate_TipTrace_1_0 bad = good;
    bad.step_exponent = static_cast<std::int8_t>(exponent);
    EXPECT_EQ(check_tips(bad), Status::payload_malformed) << exponent;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const float value :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
      palpate_TipTrace_1_0 bad = good;
      bad.tip_m[axis] = value;
      EXPECT_EQ(check_tips(bad), Status::payload_malformed) << axis;
    }
  }
}

}  // namespace
}  // namespace palpate::wire
