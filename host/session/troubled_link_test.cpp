#include "host/session/troubled_link.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "host/link/can_bus.hpp"
#include "host/link/uart.hpp"

namespace palpate::host {
namespace {

using Bytes = std::vector<std::uint8_t>;

ClosedLoopConfig on_can(const LinkTroubles& troubles) {
  ClosedLoopConfig config;
  config.framing = link::FramingKind::can_classic;
  config.troubles = troubles;
  return config;
}

Bytes request(link::HostEndpoint& host) {
  return host.encode(palpate_GetInfo_Request_1_0{}).bytes;
}

// For as long as a node babbles no frame of another one passes, and then at once; the node fills the bus and
// no more.
TEST(TroubledLink, ABabblingNodeLeavesNothingOfTheBus) {
  constexpr std::uint32_t kFrom = 10, kUntil = 300;
  LinkTroubles troubles;
  troubles.babble = {{kFrom, kUntil}};
  link::MeteredCanBus bus(link::kClassicCan_1_Mbit);
  TroubledLink link(bus.down(), bus.up(), on_can(troubles));
  link::HostEndpoint host({.framing = link::FramingKind::can_classic});
  for (std::uint32_t tick = 0; tick < kFrom + 2; ++tick) {
    (void)link.to_board(tick);
    link.send_of_others(tick);
  }
  const Bytes ours = request(host);
  link.send_down(ours, kFrom + 2);
  std::vector<std::uint32_t> ours_at;
  for (std::uint32_t tick = kFrom + 2; tick < kUntil + 10; ++tick) {
    const Bytes came = link.to_board(tick);
    if (std::search(came.begin(), came.end(), ours.begin(), ours.end()) != came.end())
      ours_at.push_back(tick);
    link.send_of_others(tick);
  }
  ASSERT_EQ(ours_at.size(), 1u);
  EXPECT_GE(ours_at[0], kUntil);
  EXPECT_LE(ours_at[0], kUntil + 2);
  EXPECT_NEAR(bus.down().counters().busy_ticks, kUntil - kFrom, 2.0);
}

// Of a cable that is out each transfer counts once, however many frames it has.
TEST(TroubledLink, TransfersThatACableKeepsAreCounted) {
  LinkTroubles troubles;
  troubles.unplugged = {{5, 8}};
  link::MeteredCanBus bus(link::kClassicCan_1_Mbit);
  TroubledLink link(bus.down(), bus.up(), on_can(troubles));
  link::HostEndpoint host({.framing = link::FramingKind::can_classic});
  palpate_ModelState_1_0 state{};  // many frames
  for (std::uint32_t tick = 0; tick < 20; ++tick) {
    link.send_down(host.encode(state).bytes, tick);
    link.send_of_others(tick);
  }
  EXPECT_EQ(link.counters().frames_removed_down, 3u);
  EXPECT_EQ(link.counters().frames_removed_up, 0u);
}

// What a person injects in a running loop: lost frames, errors of the bus, a babbling node.
TEST(TroubledLink, FaultsOfARunningLoopOnCan) {
  link::MeteredCanBus bus(link::kClassicCan_1_Mbit);
  TroubledLink link(bus.down(), bus.up(), on_can({}));
  link::HostEndpoint host({.framing = link::FramingKind::can_classic});
  const auto sends = [&](std::uint32_t tick) {
    link.send_down(request(host), tick);
    link.send_of_others(tick);
    return !link.to_board(tick + 1).empty();
  };
  EXPECT_TRUE(sends(0));
  link.add_fault(true, {.frame = 0, .kind = link::FaultKind::drop});
  EXPECT_FALSE(sends(10));
  EXPECT_EQ(link.hit_ticks(true), std::vector<std::uint32_t>{10});
  EXPECT_EQ(link.counters().down.hit[link::FaultKind::drop], 1u);
  EXPECT_TRUE(sends(20));
  link.add_fault(true, {.frame = 0, .kind = link::FaultKind::flip_bit});
  EXPECT_TRUE(sends(30));  // again
  EXPECT_EQ(bus.down().counters().attempts_failed, 1u);
  link.set_babbling(true);
  for (std::uint32_t tick = 40; tick < 45; ++tick) link.send_of_others(tick);
  EXPECT_GT(link.counters().foreign_frames, 20u);
  link.set_babbling(false);
  const std::uint64_t babbled = link.counters().foreign_frames;
  link.send_of_others(46);
  EXPECT_EQ(link.counters().foreign_frames, babbled);
}

TEST(TroubledLink, RefusesWhatIsOfAnotherMedium) {
  link::Uart down(12'000'000), up(12'000'000);
  ClosedLoopConfig config;
  config.troubles.babble = {{0, 1}};
  EXPECT_THROW(TroubledLink(down, up, config), std::invalid_argument);
  config = {};
  TroubledLink serial(down, up, config);
  EXPECT_THROW(serial.set_babbling(true), std::invalid_argument);
  EXPECT_FALSE(down.fail_attempts(1));
  config = on_can({});
  config.faults_up = {{.frame = 1}};
  EXPECT_THROW(TroubledLink(down, up, config), std::invalid_argument);
}

// A USB bus has one host and repeats what an error has hit; and only its devices refuse packets.
TEST(TroubledLink, RefusesWhatAUsbBusCannotDo) {
  link::UsbHost usb;
  const auto make = [&](const auto& change, link::UsbHost* host) {
    ClosedLoopConfig config;
    change(config);
    TroubledLink(usb.down(), usb.up(), config, host);
  };
  const auto nothing = [](ClosedLoopConfig&) {};
  const auto refused = [](ClosedLoopConfig& config) { config.troubles.refused = {{0, 1}}; };
  EXPECT_NO_THROW(make(nothing, &usb));
  EXPECT_NO_THROW(make(refused, &usb));
  EXPECT_THROW(make(refused, nullptr), std::invalid_argument);
  const auto refuses = [&](const auto& change) { EXPECT_THROW(make(change, &usb), std::invalid_argument); };
  refuses([](ClosedLoopConfig& config) { config.troubles.second_host = {{0, 1}}; });
  refuses([](ClosedLoopConfig& config) { config.troubles.flood = {{.span = {0, 1}}}; });
  refuses([](ClosedLoopConfig& config) { config.troubles.babble = {{0, 1}}; });
  refuses([](ClosedLoopConfig& config) { config.troubles.random_up = {{}}; });
  refuses([](ClosedLoopConfig& config) { config.faults_down = {{}}; });
}

}  // namespace
}  // namespace palpate::host
