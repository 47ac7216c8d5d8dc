#include "host/bench/link_cost.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "host/link/can_cost.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::host::bench {
namespace {

constexpr double kLargest = wire::kLargestPayloadToBoard;
constexpr std::uint32_t kTicks = 2000;
// A message that is on its way at either end of the time that is counted.
constexpr double kTolerance = 0.01;

// By the definition of each medium: 10 bits a byte; the transfer's longest time; at most 1,216 bytes a tick.
TEST(MediumLimit, IsTheMediumsOwn) {
  const MediumLimit line = measure_medium_limit({.medium = link::MediumKind::uart, .baud = 921'600}, kTicks);
  EXPECT_NEAR(line.link_bytes_per_s, 92'160.0, kTolerance * 92'160.0);
  const auto on_can = [](const link::CanBus& bus) { return kLargest / link::can_transfer_s(bus, kLargest); };
  const MediumLimit can = measure_medium_limit({.medium = link::MediumKind::can}, 20 * kTicks);
  EXPECT_NEAR(can.message_bytes_per_s, on_can(link::kClassicCan_1_Mbit),
              kTolerance * on_can(link::kClassicCan_1_Mbit));
  const MediumLimit fd = measure_medium_limit({.medium = link::MediumKind::canfd}, kTicks);
  EXPECT_NEAR(fd.message_bytes_per_s, on_can(link::kCanFd_5_Mbit), kTolerance * on_can(link::kCanFd_5_Mbit));
  const MediumLimit usb = measure_medium_limit({.medium = link::MediumKind::usb}, kTicks);
  EXPECT_LE(usb.link_bytes_per_s, 1'235'000.0);
  EXPECT_GE(usb.link_bytes_per_s, 0.95 * 1'216'000.0);  // each message ends with a shorter packet
  for (const MediumLimit& limit : {line, can, fd, usb}) {
    EXPECT_LE(limit.busy_share, 1.0 + 1e-9);
    EXPECT_GE(limit.busy_share, 0.94);  // on USB, beside two questions a frame and what no packet fits in
  }
}

TEST(HostCost, IsOfEveryMessageOnEveryFraming) {
  for (const auto framing :
       {link::FramingKind::serial, link::FramingKind::can_classic, link::FramingKind::can_fd}) {
    const std::vector<HostMessageCost> costs = measure_host_cost(framing, 3);
    ASSERT_EQ(costs.size(), 4u);
    for (const HostMessageCost& cost : costs) {
      EXPECT_GT(cost.link_bytes, cost.message_bytes) << cost.message;
      EXPECT_GT(cost.seconds, 0.0) << cost.message;
    }
    EXPECT_EQ(costs[0].message_bytes, 586u);  // docs/protocol.md
  }
  EXPECT_THROW((void)measure_host_cost(link::FramingKind::serial, 0), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host::bench
