#include "host/link/fault_plan.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Four frames with a delimiter at both ends.
const Bytes kStream{0, 1, 2, 3, 0, 0, 4, 5, 0, 0, 6, 7, 8, 0, 0, 9, 0};

Bytes apply(const Fault& fault) {
  FaultPlan plan(std::span(&fault, 1));
  Bytes out = plan.apply(kStream);
  EXPECT_EQ(plan.frames_seen(), 4u);
  EXPECT_EQ(plan.faults_applied().sum(), 1u);
  return out;
}

TEST(FaultPlan, EmptyPlanChangesNothing) {
  FaultPlan plan;
  EXPECT_EQ(plan.apply(kStream), kStream);
  EXPECT_EQ(plan.frames_seen(), 4u);
  EXPECT_EQ(plan.faults_applied().sum(), 0u);
}

TEST(FaultPlan, EachKindHitsItsFrameOnly) {
  EXPECT_EQ(apply({1, FaultKind::drop, 0}), (Bytes{0, 1, 2, 3, 0, 0, 0, 6, 7, 8, 0, 0, 9, 0}));
  EXPECT_EQ(apply({1, FaultKind::flip_bit, 9}), (Bytes{0, 1, 2, 3, 0, 0, 4, 7, 0, 0, 6, 7, 8, 0, 0, 9, 0}));
  EXPECT_EQ(apply({1, FaultKind::flip_bit, 16 + 9}),
            (Bytes{0, 1, 2, 3, 0, 0, 4, 7, 0, 0, 6, 7, 8, 0, 0, 9, 0}));
  EXPECT_EQ(apply({2, FaultKind::truncate, 1}), (Bytes{0, 1, 2, 3, 0, 0, 4, 5, 0, 0, 6, 0, 9, 0}));
  EXPECT_EQ(apply({3, FaultKind::duplicate, 0}),
            (Bytes{0, 1, 2, 3, 0, 0, 4, 5, 0, 0, 6, 7, 8, 0, 0, 9, 0, 9, 0}));
  EXPECT_EQ(apply({0, FaultKind::duplicate, 2}),
            (Bytes{0, 1, 2, 3, 0, 0, 4, 5, 0, 0, 6, 7, 8, 0, 1, 2, 3, 0, 0, 9, 0}));
  EXPECT_EQ(apply({0, FaultKind::reorder, 1}), (Bytes{0, 0, 4, 5, 0, 1, 2, 3, 0, 0, 6, 7, 8, 0, 0, 9, 0}));
  EXPECT_EQ(apply({1, FaultKind::reorder, 2}), (Bytes{0, 1, 2, 3, 0, 0, 0, 6, 7, 8, 0, 0, 9, 0, 4, 5, 0}));
}

TEST(FaultPlan, WhatIsToComeBehindFramesThatNeverComeIsLost) {
  EXPECT_EQ(apply({3, FaultKind::reorder, 1}), (Bytes{0, 1, 2, 3, 0, 0, 4, 5, 0, 0, 6, 7, 8, 0, 0}));
}

TEST(FaultPlan, AFrameComesLateBehindOneThatIsSpoilt) {
  const std::array<Fault, 2> faults{Fault{0, FaultKind::reorder, 1}, Fault{1, FaultKind::drop, 0}};
  EXPECT_EQ(FaultPlan(faults).apply(kStream), (Bytes{0, 0, 1, 2, 3, 0, 0, 6, 7, 8, 0, 0, 9, 0}));
}

TEST(FaultPlan, CuttingDoesNotMatter) {
  const std::array<Fault, 4> faults{Fault{0, FaultKind::duplicate, 0}, Fault{1, FaultKind::reorder, 1},
                                    Fault{2, FaultKind::truncate, 2}, Fault{3, FaultKind::flip_bit, 3}};
  const Bytes whole = FaultPlan(faults).apply(kStream);
  for (std::size_t run = 1; run < kStream.size(); ++run) {
    FaultPlan plan(faults);
    Bytes out;
    for (std::size_t at = 0; at < kStream.size(); at += run) {
      const Bytes piece = plan.apply(std::span(kStream).subspan(at, std::min(run, kStream.size() - at)));
      out.insert(out.end(), piece.begin(), piece.end());
    }
    EXPECT_EQ(out, whole) << run;
  }
}

TEST(FaultPlan, BytesOfOtherFramesPassAtOnce) {
  const Fault fault{1, FaultKind::drop, 0};
  FaultPlan plan(std::span(&fault, 1));
  EXPECT_EQ(plan.apply(Bytes{0, 1, 2}), (Bytes{0, 1, 2}));
  EXPECT_EQ(plan.apply(Bytes{0, 0, 4}), (Bytes{0, 0}));
  EXPECT_EQ(plan.apply(Bytes{5}), Bytes{});
  EXPECT_EQ(plan.apply(Bytes{0, 6}), (Bytes{6}));
}

TEST(FaultPlan, OneFaultAFrame) {
  const std::array<Fault, 2> faults{Fault{7, FaultKind::drop, 0}, Fault{7, FaultKind::truncate, 2}};
  EXPECT_THROW(FaultPlan{faults}, std::invalid_argument);
  const Fault behind_none{7, FaultKind::reorder, 0};
  EXPECT_THROW(FaultPlan{std::span(&behind_none, 1)}, std::invalid_argument);
}

TEST(FaultPlan, FaultsAddedLaterCountFromTheNextFrameThatBegins) {
  FaultPlan plan;
  EXPECT_EQ(plan.apply(Bytes{0, 1}), (Bytes{0, 1}));  // a frame has begun
  EXPECT_TRUE(plan.add({0, FaultKind::drop, 0}));
  EXPECT_TRUE(plan.add({1, FaultKind::flip_bit, 1}));
  EXPECT_FALSE(plan.add({1, FaultKind::drop, 0}));
  EXPECT_THROW(plan.add({2, FaultKind::reorder, 0}), std::invalid_argument);
  EXPECT_EQ(plan.apply(Bytes{2, 0, 3, 0, 4, 0, 5, 0}), (Bytes{2, 0, 6, 0, 5, 0}));
  EXPECT_EQ(plan.faults_applied().sum(), 2u);
}

// Frames of 20 bytes, numbered.
Bytes numbered_frames(std::size_t count) {
  Bytes bytes;
  for (std::size_t i = 0; i < count; ++i) {
    bytes.push_back(0);
    for (int byte = 0; byte < 20; ++byte) bytes.push_back(static_cast<std::uint8_t>(1 + i % 250));
    bytes.push_back(0);
  }
  return bytes;
}

TEST(FaultPlan, ChanceHitsAsOftenAsItSaysAndTheSameOfTheSameSeed) {
  constexpr std::size_t kFrames = 4000;
  for (const FaultKind kind : {FaultKind::drop, FaultKind::flip_bit, FaultKind::duplicate}) {
    for (const double chance : {0.0, 0.1, 1.0}) {
      FaultPlan plan, again, other;
      plan.add({kind, chance}, 1);
      again.add({kind, chance}, 1);
      other.add({kind, chance}, 2);
      const Bytes out = plan.apply(numbered_frames(kFrames));
      EXPECT_EQ(out, again.apply(numbered_frames(kFrames)));
      // Five standard deviations of 4,000 draws.
      const double spread = 5.0 * std::sqrt(chance * (1.0 - chance) * kFrames);
      EXPECT_NEAR(static_cast<double>(plan.faults_applied().sum()), chance * kFrames, spread);
      EXPECT_EQ(plan.frames_spoilt(), kind == FaultKind::duplicate ? 0 : plan.faults_applied().sum());
      if (chance == 0.1) {
        EXPECT_NE(out, other.apply(numbered_frames(kFrames)));
      }
    }
  }
}

TEST(FaultPlan, CountsByKind) {
  FaultPlan plan(std::vector<Fault>{{0, FaultKind::drop, 0},
                                    {1, FaultKind::flip_bit, 3},
                                    {2, FaultKind::flip_bit, 4},
                                    {4, FaultKind::truncate, 2},
                                    {5, FaultKind::duplicate, 0},
                                    {6, FaultKind::reorder, 1},
                                    {1000, FaultKind::drop, 0}});
  (void)plan.apply(numbered_frames(10));
  const FaultCounts& counts = plan.faults_applied();
  EXPECT_EQ(counts[FaultKind::drop], 1u);  // the other one has not come
  EXPECT_EQ(counts[FaultKind::flip_bit], 2u);
  EXPECT_EQ(counts[FaultKind::truncate], 1u);
  EXPECT_EQ(counts[FaultKind::duplicate], 1u);
  EXPECT_EQ(counts[FaultKind::reorder], 1u);
  EXPECT_EQ(counts.sum(), 6u);
}

TEST(FaultPlan, ChanceKeepsToItsTicksAndToWhatIsPlanned) {
  FaultPlan plan;
  plan.add({FaultKind::drop, 1.0, 10, 20}, 1);
  EXPECT_EQ(plan.apply(numbered_frames(1), 9), numbered_frames(1));
  EXPECT_EQ(plan.apply(numbered_frames(1), 10), (Bytes(1, 0)));
  EXPECT_TRUE(plan.add({0, FaultKind::duplicate, 0}));
  EXPECT_EQ(plan.apply(numbered_frames(1), 19).size(), 2 * numbered_frames(1).size() - 1);
  EXPECT_EQ(plan.apply(numbered_frames(1), 20), numbered_frames(1));
  EXPECT_EQ(plan.frames_spoilt(), 1u);
  EXPECT_THROW(plan.add({FaultKind::drop, 1.1}, 1), std::invalid_argument);
}

// A frame that is cut behind its end is whole: the delimiter of the next one ends it.
TEST(FaultPlan, CutsCountWhereTheyCostSomething) {
  FaultPlan plan;
  plan.add({FaultKind::truncate, 1.0}, 1);
  const Bytes out = plan.apply(numbered_frames(2000));
  std::size_t whole = 0, run = 0;
  for (const std::uint8_t byte : out) {
    run = byte == 0 ? 0 : run + 1;
    whole += run == 20 ? 1 : 0;
  }
  EXPECT_EQ(plan.faults_applied().sum(), 2000u);
  EXPECT_EQ(plan.frames_spoilt(), 2000 - whole);
  EXPECT_GT(plan.frames_spoilt(), 0u);
}

}  // namespace
}  // namespace palpate::link
