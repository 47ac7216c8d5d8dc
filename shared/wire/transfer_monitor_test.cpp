#include "shared/wire/transfer_monitor.hpp"

#include <gtest/gtest.h>

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
