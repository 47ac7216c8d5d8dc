#include "host/link/can_fault_plan.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "host/link/can_record_bytes.hpp"
#include "shared/wire/can_frame.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

// A transfer of so many frames, a record each.
std::vector<Bytes> transfer(std::uint32_t identifier, int frames, std::uint8_t id) {
  std::vector<Bytes> records;
  for (int i = 0; i < frames; ++i) {
    const Bytes data{static_cast<std::uint8_t>(i),
                     wire::can_tail_byte({i == 0, i == frames - 1, i % 2 == 0, id})};
    records.push_back(can_record_of({.identifier = identifier, .fd = false, .data = data}));
  }
  return records;
}

Bytes joined(const std::vector<Bytes>& records) {
  Bytes bytes;
  for (const Bytes& record : records) bytes.insert(bytes.end(), record.begin(), record.end());
  return bytes;
}

TEST(CanFaultPlan, WithoutFaultsRecordsPassHoweverTheyAreCut) {
  const Bytes stream = joined(transfer(100, 5, 1));
  for (std::size_t run = 1; run <= stream.size(); ++run) {
    CanFaultPlan plan;
    Bytes out;
    for (std::size_t at = 0; at < stream.size(); at += run) {
      const Bytes piece = plan.apply(std::span(stream).subspan(at, std::min(run, stream.size() - at)), 0);
      out.insert(out.end(), piece.begin(), piece.end());
    }
    EXPECT_EQ(out, stream) << run;
    EXPECT_EQ(plan.transfers_spoilt(), 0u);
  }
}

// However many of a transfer's frames are lost, it is one; transfers of two identifiers may be interleaved.
TEST(CanFaultPlan, ATransferIsSpoiltOnce) {
  CanFaultPlan plan;
  plan.add({.kind = FaultKind::drop, .chance = 1.0, .first_tick = 5, .end_tick = 6}, 1);
  const std::vector<Bytes> a = transfer(100, 4, 1), b = transfer(200, 2, 1);
  EXPECT_EQ(plan.apply(a[0], 4), a[0]);
  EXPECT_EQ(plan.apply(b[0], 4), b[0]);
  EXPECT_EQ(plan.apply(joined({a[1], a[2]}), 5), Bytes{});
  EXPECT_EQ(plan.apply(joined({a[3], b[1]}), 6), joined({a[3], b[1]}));
  EXPECT_EQ(plan.transfers_spoilt(), 1u);
  EXPECT_EQ(plan.faults_applied().sum(), 2u);
  EXPECT_EQ(plan.apply(joined(transfer(100, 2, 2)), 7, true), Bytes{});
  EXPECT_EQ(plan.transfers_spoilt(), 2u);
}

TEST(CanFaultPlan, ACopyComesRightBehindItsFrame) {
  CanFaultPlan plan;
  plan.add({.kind = FaultKind::duplicate, .chance = 1.0}, 1);
  const std::vector<Bytes> records = transfer(100, 2, 1);
  EXPECT_EQ(plan.apply(joined(records), 0), joined({records[0], records[0], records[1], records[1]}));
  EXPECT_EQ(plan.transfers_spoilt(), 0u);
}

TEST(CanFaultPlan, FramesThatArePlannedAreHitAndCountedByKind) {
  CanFaultPlan plan;
  const std::vector<Bytes> records = transfer(100, 6, 1);
  EXPECT_EQ(plan.apply(records[0], 0), records[0]);
  EXPECT_TRUE(plan.add({.frame = 1, .kind = FaultKind::drop}));
  EXPECT_FALSE(plan.add({.frame = 1, .kind = FaultKind::duplicate}));  // has one
  EXPECT_TRUE(plan.add({.frame = 2, .kind = FaultKind::duplicate}));
  EXPECT_EQ(plan.apply(joined({records[1], records[2], records[3], records[4]}), 1),
            joined({records[1], records[3], records[3], records[4]}));
  EXPECT_EQ(plan.faults_applied()[FaultKind::drop], 1u);
  EXPECT_EQ(plan.faults_applied()[FaultKind::duplicate], 1u);
  EXPECT_EQ(plan.frames_cut(), 0u);
  EXPECT_EQ(plan.apply(joined({records[4], records[5]}), 2, true), Bytes{});
  EXPECT_EQ(plan.frames_cut(), 2u);
  EXPECT_EQ(plan.transfers_spoilt(), 1u);
  EXPECT_THROW((void)plan.add({.frame = 0, .kind = FaultKind::truncate}), std::invalid_argument);
}

TEST(CanFaultPlan, ChanceHitsAsOftenAsItSays) {
  constexpr double kChance = 0.1;
  constexpr int kFrames = 10'000;
  CanFaultPlan plan;
  plan.add({.kind = FaultKind::drop, .chance = kChance}, 7);
  for (int i = 0; i < kFrames; ++i) (void)plan.apply(joined(transfer(100, 1, 0)), 0);
  // Six standard deviations of the binomial distribution.
  EXPECT_NEAR(static_cast<double>(plan.transfers_spoilt()), kChance * kFrames,
              6.0 * std::sqrt(kFrames * kChance * (1.0 - kChance)));
}

TEST(CanFaultPlan, RefusesWhatNoBusDoes) {
  CanFaultPlan plan;
  for (const FaultKind kind : {FaultKind::truncate, FaultKind::reorder, FaultKind::flip_bit})
    EXPECT_THROW(plan.add({.kind = kind, .chance = 0.5}, 1), std::invalid_argument);
  for (const double chance : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(plan.add({.kind = FaultKind::drop, .chance = chance}, 1), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::link
