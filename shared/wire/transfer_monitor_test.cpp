#include "shared/wire/transfer_monitor.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace palpate::wire {
namespace {

FrameHeader transfer(std::uint64_t id, std::uint16_t specifier = 1600, std::uint16_t source = 42) {
  return {.source = source, .specifier = specifier, .transfer_id = id};
}

TEST(TransferMonitor, NoGapNoLoss) {
  TransferMonitor monitor;
  for (std::uint64_t id = 5; id < 100; ++id) EXPECT_EQ(monitor.observe(transfer(id), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 0u);
}

TEST(TransferMonitor, CountsEveryMissingTransfer) {
  TransferMonitor monitor;
  std::uint32_t skipped = 0;
  std::uint64_t id = 0;
  for (std::uint64_t gap = 0; gap < 50; ++gap) {
    EXPECT_EQ(monitor.observe(transfer(id), 0), TransferKind::fresh);
    id += gap + 1;
    skipped += static_cast<std::uint32_t>(gap);
  }
  EXPECT_EQ(monitor.observe(transfer(id), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), skipped);
}

TEST(TransferMonitor, IdentifierWrapsWithoutLoss) {
  TransferMonitor monitor;
  EXPECT_EQ(monitor.observe(transfer(~std::uint64_t{0}), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(0), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 0u);
}

TEST(TransferMonitor, RepeatIsOnlyOneWithinTheTimeout) {
  TransferMonitor monitor;
  const std::uint32_t start = 0xFFFFFFF0u;  // the tick counter wraps meanwhile
  EXPECT_EQ(monitor.observe(transfer(3), start), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(3), start), TransferKind::repeat);
  EXPECT_EQ(monitor.observe(transfer(3), start + kTransferIdTimeout_ticks - 1), TransferKind::repeat);
  EXPECT_EQ(monitor.observe(transfer(3), start + kTransferIdTimeout_ticks), TransferKind::fresh);
  EXPECT_EQ(monitor.repeated(), 2u);
  EXPECT_EQ(monitor.lost(), 0u);
}

TEST(TransferMonitor, PeerThatStartsAgainIsNoLoss) {
  TransferMonitor monitor;
  EXPECT_EQ(monitor.observe(transfer(500), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(0), 1), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(1), 2), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(1 + kLargestTransferGap + 1), 3), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 0u);
}

// What takes them out of order: the numbers in the order of their arrival, and what is to be known of them.
struct Arrivals {
  std::vector<std::uint64_t> ids;
  std::uint32_t lost, repeated, late;
};

void expect(const Arrivals& arrivals) {
  TransferMonitor monitor;
  for (const std::uint64_t id : arrivals.ids) (void)monitor.observe(transfer(id), 0);
  EXPECT_EQ(monitor.lost(), arrivals.lost);
  EXPECT_EQ(monitor.repeated(), arrivals.repeated);
  EXPECT_EQ(monitor.late(), arrivals.late);
}

TEST(TransferMonitor, TransferAgainBehindLaterOnesIsNoLoss) {
  expect({.ids = {10, 11, 12, 10, 13, 12, 11, 14}, .lost = 0, .repeated = 3, .late = 0});
}

TEST(TransferMonitor, LateTransferTakesItsLossBack) {
  expect({.ids = {10, 12, 13, 11, 14, 11}, .lost = 0, .repeated = 1, .late = 1});
  expect({.ids = {10, 14, 13, 11}, .lost = 1, .repeated = 0, .late = 2});  // without 12
}

TEST(TransferMonitor, TransferBeforeTheFirstIsLateAndNothingIsMissing) {
  expect({.ids = {11, 10, 10, 12}, .lost = 0, .repeated = 1, .late = 1});
}

TEST(TransferMonitor, WindowEndsWhereItSays) {
  const std::uint64_t far = 10 + kTransferWindow;
  expect({.ids = {10, far, 11, far + 1}, .lost = kTransferWindow - 2, .repeated = 0, .late = 1});
  // One further back is of a peer that started again, so that the next one is far ahead.
  expect({.ids = {10, far + 1, 11, 12}, .lost = kTransferWindow, .repeated = 0, .late = 0});
  expect({.ids = {10, 10 + 3 * kTransferWindow, 9 + 3 * kTransferWindow},
          .lost = 3 * kTransferWindow - 2,
          .repeated = 0,
          .late = 1});
}

// Whose numbers are all in the window yet: a run of them again, none new between, tells it.
TEST(TransferMonitor, PeerThatStartsAgainWithinItsFirstTransfersIsTakenAfterAFew) {
  TransferMonitor monitor;
  for (std::uint64_t id = 0; id < 6; ++id) (void)monitor.observe(transfer(id), 0);
  std::uint64_t id = 0;
  for (; id + 1 < kRestartRun; ++id) EXPECT_EQ(monitor.observe(transfer(id), 1), TransferKind::repeat);
  for (; id < 20; ++id) EXPECT_EQ(monitor.observe(transfer(id), 1), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 0u);
  EXPECT_EQ(monitor.late(), 0u);
}

// A board that starts again says so by its traces, which are many, before it reports its first model.
TEST(TransferMonitor, PeerThatStartsAgainOnOnePortDoesOnAll) {
  constexpr std::uint16_t kTraces = 1600, kReports = 1602, kOther = 11;
  TransferMonitor monitor;
  for (std::uint64_t id = 0; id < 100; ++id) (void)monitor.observe(transfer(id, kTraces), 0);
  for (std::uint64_t id = 0; id < 4; ++id) {
    (void)monitor.observe(transfer(id, kReports), 0);
    (void)monitor.observe(transfer(id, kReports, kOther), 0);
  }
  EXPECT_EQ(monitor.observe(transfer(0, kReports), 100), TransferKind::repeat);
  EXPECT_EQ(monitor.observe(transfer(0, kTraces), 100), TransferKind::fresh);
  for (std::uint64_t id = 0; id < 4; ++id)
    EXPECT_EQ(monitor.observe(transfer(id, kReports), 100), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(0, kReports, kOther), 100), TransferKind::repeat);  // it has not
  EXPECT_EQ(monitor.lost(), 0u);
}

// Its port alone: what others have sent meanwhile is not forgotten.
TEST(TransferMonitor, NumberOfBeforeAfterTheTimeoutSaysNothingOfOtherPorts) {
  constexpr std::uint16_t kStatus = 1601, kCommand = 300;
  TransferMonitor monitor;
  (void)monitor.observe(transfer(5, kCommand), 0);
  (void)monitor.observe(transfer(7, kStatus), kTransferIdTimeout_ticks);
  EXPECT_EQ(monitor.observe(transfer(5, kCommand), kTransferIdTimeout_ticks), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(7, kStatus), kTransferIdTimeout_ticks), TransferKind::repeat);
}

TEST(TransferMonitor, NothingIsLateAfterTheTimeout) {
  TransferMonitor monitor;
  (void)monitor.observe(transfer(10), 0);
  (void)monitor.observe(transfer(12), 0);
  EXPECT_EQ(monitor.observe(transfer(11), kTransferIdTimeout_ticks), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 1u);
  EXPECT_EQ(monitor.late(), 0u);
}

TEST(TransferMonitor, SourcesAndSpecifiersAreCountedApart) {
  TransferMonitor monitor;
  EXPECT_EQ(monitor.observe(transfer(1, 1600, 42), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(1, 1601, 42), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(1, 1600, 43), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(3, 1601, 42), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 1u);
  EXPECT_EQ(monitor.observe(transfer(1, 1600, 42), 0), TransferKind::repeat);
}

// More ports than entries: the one that was silent longest is forgotten, the others keep their count.
TEST(TransferMonitor, FullTableForgetsTheOldest) {
  TransferMonitor monitor;
  for (std::uint16_t port = 0; port < kMonitoredPorts; ++port)
    EXPECT_EQ(monitor.observe(transfer(1, port), port), TransferKind::fresh);
  EXPECT_EQ(monitor.observe(transfer(1, 900), 100), TransferKind::fresh);  // takes the place of port 0
  EXPECT_EQ(monitor.observe(transfer(3, 1), 100), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), 1u);
  EXPECT_EQ(monitor.observe(transfer(9, 0), 101), TransferKind::fresh);  // forgotten, so nothing is missing
  EXPECT_EQ(monitor.lost(), 1u);
}

// Five bits, as on CAN: the identifier wraps every 32 transfers, and up to 30 missing in a row are counted.
TEST(TransferMonitor, FiveBitIdentifiersWrap) {
  constexpr unsigned kIdBits = 5;
  TransferMonitor monitor(kIdBits);
  std::uint32_t skipped = 0;
  std::uint64_t id = 0;
  for (std::uint64_t gap = 0; gap <= 30; ++gap) {
    EXPECT_EQ(monitor.observe(transfer(id % 32), 0), TransferKind::fresh);
    id += gap + 1;
    skipped += static_cast<std::uint32_t>(gap);
  }
  EXPECT_EQ(monitor.observe(transfer(id % 32), 0), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), skipped);
  EXPECT_EQ(monitor.observe(transfer(id % 32), 1), TransferKind::repeat);
  EXPECT_EQ(monitor.observe(transfer(id % 32), kTransferIdTimeout_ticks), TransferKind::fresh);
  EXPECT_EQ(monitor.lost(), skipped);
}

}  // namespace
}  // namespace palpate::wire
