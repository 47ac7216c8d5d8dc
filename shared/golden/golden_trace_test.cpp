#include "shared/golden/golden_trace.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace palpate::golden {
namespace {

TEST(Fnv1a, IsThePublishedFunction) {
  // From the test vectors of Fowler, Noll and Vo: "foob".
  Fnv1a hash;
  hash.add(std::uint32_t{0x626f6f66u});
  EXPECT_EQ(hash.value(), 0xdd120e790c2512afull);
}

TEST(GoldenTrace, GoesThroughEverythingThatContactCanDo) {
  const auto trace = std::make_unique<GoldenTrace>();
  const Counters counters = trace->run().counters;
  EXPECT_GE(counters.free_ticks, 300u);
  EXPECT_GE(counters.stick_ticks, 300u);
  EXPECT_GE(counters.slip_ticks, 800u);
  EXPECT_GE(counters.touches, 4u);
  EXPECT_GE(counters.separations, 3u);
  EXPECT_GE(counters.stick_to_slip, 3u);
  EXPECT_GE(counters.slip_to_stick, 3u);
  EXPECT_GE(counters.edge_crossings, 10u);
  EXPECT_GE(counters.border_ticks, 10u);
  EXPECT_GE(counters.limited_currents, 10u);
  // Both kinds of poses, of 3,000.
  EXPECT_GE(counters.pose_faults, 100u);
  EXPECT_LE(counters.pose_faults, 2000u);
  // Of the order of what the device can render.
  EXPECT_GT(counters.largest_force_N, 0.1f);
  EXPECT_LT(counters.largest_force_N, 20.0f);
}

TEST(GoldenTrace, FeelsItsSprings) {
  const auto trace = std::make_unique<GoldenTrace>();
  const Result result = trace->run();
  EXPECT_NE(result.near_hash, result.model_hash);
  EXPECT_GE(result.near.stick_ticks, 300u);
  EXPECT_GE(result.near.slip_ticks, 800u);
  EXPECT_GE(result.near.edge_crossings, 10u);
  EXPECT_LT(result.near.largest_force_N, 20.0f);
}

TEST(GoldenTrace, IsFeltInEveryWay) {
  const auto trace = std::make_unique<GoldenTrace>();
  const Result result = trace->run();
  const Counters& felt = result.felt;
  EXPECT_GE(felt.free_ticks, 800u);
  EXPECT_GE(felt.stick_ticks, 800u);
  EXPECT_GE(felt.slip_ticks, 3000u);
  EXPECT_GE(felt.touches, 8u);  // each way from inside and from outside
  EXPECT_GE(felt.separations, 8u);
  EXPECT_GE(felt.stick_to_slip, 10u);
  EXPECT_GE(felt.slip_to_stick, 10u);
  EXPECT_GE(felt.edge_crossings, 40u);
  EXPECT_GE(felt.border_ticks, 200u);
  EXPECT_GE(felt.inset_ticks, 600u);  // 150 in each way
  EXPECT_GE(felt.stretched_ticks, 3000u);
  EXPECT_GT(felt.largest_force_N, 0.1f);
  EXPECT_LT(felt.largest_force_N, 20.0f);
  // More than a count, less than the two of each joint that the estimate may be away.
  EXPECT_GT(result.farthest_estimate_m, 0.03e-3f);
  EXPECT_LT(result.farthest_estimate_m, 3 * 2 * 0.03e-3f);
}

TEST(GoldenTrace, RunsTheSameEachTime) {
  const auto trace = std::make_unique<GoldenTrace>(), other = std::make_unique<GoldenTrace>();
  const Result first = trace->run(), second = trace->run(), third = other->run();
  for (const Result& again : {second, third}) {
    EXPECT_EQ(again.model_hash, first.model_hash);
    EXPECT_EQ(again.near_hash, first.near_hash);
    EXPECT_EQ(again.felt_hash, first.felt_hash);
    EXPECT_EQ(again.work, first.work);
    EXPECT_EQ(again.device_hash, first.device_hash);
    EXPECT_EQ(again.math_hash, first.math_hash);
  }
}

}  // namespace
}  // namespace palpate::golden
