#include "host/link/usb_host.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <stdexcept>

#include "host/link/usb_ideal_device.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes counting(std::size_t count, std::size_t first = 0) {
  Bytes bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>((first + i) % 251);
  return bytes;
}

// A device at the bus, tick by tick.
struct Bus {
  explicit Bus(BusErrors errors = {}, std::size_t queue = 1u << 20) : host(queue, std::move(errors)) {}
  UsbHost host;
  UsbIdealDevice device;
  std::uint32_t tick = 0;
  Bytes got;  // by the program
  std::vector<std::size_t> record_bytes;

  void run(std::uint32_t ticks) {
    for (const std::uint32_t end = tick + ticks; tick < end;) {
      const Bytes records = host.down().deliver(tick);
      record_bytes.push_back(records.size());
      (void)host.up().submit(device.tick(records), tick);
      ++tick;
      const Bytes arrived = host.up().deliver(tick);
      got.insert(got.end(), arrived.begin(), arrived.end());
    }
  }
  void open() {
    for (int i = 0; i < 200 && !host.is_open(); ++i) run(1);
    ASSERT_TRUE(host.is_open());
  }
  bool send(const Bytes& frame) { return host.down().submit(frame, tick); }
};

constexpr double kNoTime = 1e-9;

// Reset and recovery take 20 ms, a stage of a control transfer two, and there are 14 of them, and 2 ms behind
// the address.
TEST(UsbHost, EnumeratesADeviceInItsTime) {
  Bus bus;
  EXPECT_FALSE(bus.send(counting(5)));
  EXPECT_EQ(bus.host.frames_unsent(), 1u);
  bus.open();
  EXPECT_GE(bus.tick, 20u + 2 * 13 + 2);
  EXPECT_LE(bus.tick, 20u + 3 * 14 + 2);
  EXPECT_EQ(bus.device.resets(), 1u);
}

// Table 5-9: 19 transactions of 64 bytes a frame, 1,216,000 bytes a second; two questions of 8 bytes beside
// them leave room for 19.
TEST(UsbHost, CarriesNineteenFullPacketsAFrame) {
  Bus bus;
  bus.open();
  bus.run(10);
  const std::size_t first = bus.device.heard().size();
  ASSERT_TRUE(bus.send(counting(1'000'000)));
  bus.run(401);
  const std::size_t heard = bus.device.heard().size() - first;
  EXPECT_EQ(heard, 400u * 1216);
  EXPECT_EQ(bus.device.heard(), counting(heard));
  bus.run(2);
  const MediumCounters down = bus.host.down().counters();
  EXPECT_NEAR(down.busy_ticks, static_cast<double>(down.bytes_delivered) / 64 * 77 / 1500, kNoTime);
  EXPECT_EQ(bus.host.down().bytes_per_tick(), 1216.0);
}

// A frame is a transfer: one that fills its last packet ends with an empty one, either way.
TEST(UsbHost, TransfersEndWithAShortPacket) {
  for (const std::size_t length : {1u, 63u, 64u, 65u, 128u, 1000u}) {
    Bus bus;
    bus.open();
    ASSERT_TRUE(bus.send(counting(length)));
    EXPECT_EQ(bus.host.down().backlog_bytes(bus.tick), length);
    bus.device.say(counting(length, 7));
    bus.run(5);
    EXPECT_EQ(bus.device.heard(), counting(length));
    EXPECT_EQ(bus.got, counting(length, 7));
    EXPECT_EQ(bus.host.down().backlog_bytes(bus.tick), 0u);
    const auto packets = static_cast<double>(length / 64 + 1);
    for (const MediumCounters& side : {bus.host.down().counters(), bus.host.up().counters()})
      EXPECT_NEAR(side.busy_ticks, (static_cast<double>(length) + 13 * packets) / 1500, kNoTime);
  }
}

// What has not ended is not the program's yet.
TEST(UsbHost, AFullPacketWithoutAnEmptyOneIsNoTransfer) {
  UsbInPipe pipe;
  const UsbAnswer full{.kind = UsbRecord::data0, .address = 0x81, .data = counting(64)};
  EXPECT_FALSE(pipe.take(full).ends_transfer);
  EXPECT_TRUE(pipe.completed().empty());
  EXPECT_TRUE(pipe.take({.kind = UsbRecord::data1, .address = 0x81, .data = {}}).ends_transfer);
  EXPECT_EQ(pipe.completed(), counting(64));
}

// Answers take their time, too: over any hundred frames no more has crossed than they have.
TEST(UsbHost, BothDirectionsShareTheBus) {
  Bus bus;
  bus.open();
  for (int i = 0; i < 40; ++i) bus.device.say(counting(6400));
  ASSERT_TRUE(bus.send(counting(400'000)));
  const double before = bus.host.down().counters().busy_ticks + bus.host.up().counters().busy_ticks;
  const std::size_t heard = bus.device.heard().size(), got = bus.got.size();
  bus.run(100);
  const double busy = bus.host.down().counters().busy_ticks + bus.host.up().counters().busy_ticks - before;
  EXPECT_LE(busy, 100.0 + 2);  // two frames are on their way at the beginning
  EXPECT_GE(busy, 90.0);       // questions and the ends of frames
  EXPECT_GT(bus.device.heard().size() - heard, 40'000u);
  EXPECT_GT(bus.got.size() - got, 40'000u);
}

// What is refused goes again, in its order, whatever went out behind it.
TEST(UsbHost, RefusedPacketsGoAgain) {
  Bus bus;
  bus.open();
  ASSERT_TRUE(bus.send(counting(20'000)));
  for (int i = 0; i < 5; ++i) {
    bus.device.refuse(1 + static_cast<std::size_t>(i % 2));
    bus.run(4);
  }
  bus.run(30);
  EXPECT_EQ(bus.device.heard(), counting(20'000));
  EXPECT_EQ(bus.device.copies(), 0u);
  EXPECT_EQ(bus.host.down().backlog_bytes(bus.tick), 0u);
}

// Each kind of damage is repaired by repeating, and a packet that arrives twice is told by its toggle.
TEST(UsbHost, DamagedPacketsGoAgainUntilTheyArrive) {
  const auto crossed_in = [](BusErrors errors, Bus& bus) {
    bus.open();
    EXPECT_TRUE(bus.send(counting(30'000)));
    for (std::size_t i = 0; i < 30; ++i) bus.device.say(counting(300, i));
    const std::uint32_t begun = bus.tick;
    while (bus.tick < begun + 2000 && (bus.device.heard().size() < 30'000 || bus.got.size() < 9000))
      bus.run(1);
    EXPECT_EQ(bus.device.heard(), counting(30'000)) << errors.errors.size();
    Bytes said;
    for (std::size_t i = 0; i < 30; ++i) {
      const Bytes one = counting(300, i);
      said.insert(said.end(), one.begin(), one.end());
    }
    EXPECT_EQ(bus.got, said);
    return bus.tick - begun;
  };
  Bus clean;
  const std::uint32_t fastest = crossed_in({}, clean);
  for (const std::size_t direction : {0u, 1u}) {
    const BusErrors errors{.errors = {{.direction = direction, .chance = 0.3}}, .seed = 3};
    Bus bus(errors);
    EXPECT_GT(crossed_in(errors, bus), fastest);
    EXPECT_GT((direction == 0 ? bus.host.down() : bus.host.up()).counters().attempts_failed, 50u);
    EXPECT_EQ(bus.device.copies() > 10, direction == 1);  // of packets whose handshake was lost
  }
}

// Equal runs, equal bytes; and another seed, other ones.
TEST(UsbHost, RepeatsToTheByte) {
  const auto run = [](std::uint32_t seed) {
    Bus bus({.errors = {{.direction = 0, .chance = 0.2}, {.direction = 1, .chance = 0.2}}, .seed = seed});
    bus.open();
    EXPECT_TRUE(bus.send(counting(20'000)));
    for (int i = 0; i < 10; ++i) bus.device.say(counting(300));
    bus.run(60);
    return bus.record_bytes;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

// What has crossed before the cable is out arrives, what has not does not; then it is enumerated anew.
TEST(UsbHost, PulledOutAndPutIn) {
  Bus bus;
  bus.open();
  ASSERT_TRUE(bus.send(counting(1000)));
  ASSERT_TRUE(bus.send(counting(5000)));
  bus.device.say(counting(64));  // as far as its full packet: its empty one is not asked for any more
  bus.run(2);
  bus.host.set_plugged(false, bus.tick);
  EXPECT_FALSE(bus.host.is_open());
  EXPECT_FALSE(bus.send(counting(10)));
  bus.run(5);
  EXPECT_EQ(bus.got, counting(64));
  EXPECT_GE(bus.device.heard().size(), 1000u);
  EXPECT_LT(bus.device.heard().size(), 6000u);
  EXPECT_EQ(bus.host.frames_unsent(), 2u);
  const std::size_t silent = bus.record_bytes.size();
  bus.run(100);
  EXPECT_EQ(
      std::count(bus.record_bytes.begin() + static_cast<std::ptrdiff_t>(silent), bus.record_bytes.end(), 0u),
      100);
  bus.host.set_plugged(true, bus.tick);
  const std::uint32_t put_in = bus.tick;
  bus.open();
  EXPECT_GE(bus.tick - put_in, 100u + 20 + 2 * 13);  // it settles first
  EXPECT_EQ(bus.device.resets(), 2u);
  const std::size_t before = bus.device.heard().size();
  ASSERT_TRUE(bus.send(counting(100)));
  bus.run(3);
  EXPECT_EQ(bus.device.heard().size(), before + 100);
}

// A program that stands still takes four transfers; then the device is not asked any more.
TEST(UsbHost, AStoppedProgramLeavesTheDeviceWaiting) {
  Bus bus;
  bus.open();
  bus.host.set_program_runs(false);
  for (int i = 0; i < 40; ++i) bus.device.say(counting(200));
  bus.run(50);
  EXPECT_GE(bus.got.size(), 4u * 200);
  EXPECT_LE(bus.got.size(), 10u * 200);  // with what was asked for already
  bus.host.set_program_runs(true);
  bus.run(50);
  EXPECT_EQ(bus.got.size(), 40u * 200);
}

TEST(UsbHost, ARefusingDeviceGetsNothing) {
  Bus bus;
  bus.open();
  bus.host.set_refused(true);
  ASSERT_TRUE(bus.send(counting(100)));
  bus.run(50);
  EXPECT_EQ(bus.device.heard().size(), 0u);
  bus.host.set_refused(false);
  bus.run(3);
  EXPECT_EQ(bus.device.heard(), counting(100));
  EXPECT_EQ(bus.host.frames_unsent(), 0u);
}

// Nothing waits for a device that has gone silent: what was handed over stays, up to the queue's limit.
TEST(UsbHost, ASilentDeviceHangsNothing) {
  Bus never;
  never.device.fall_silent();
  never.run(3000);
  EXPECT_FALSE(never.host.is_open());
  Bus bus({}, 10'000);
  bus.open();
  bus.device.fall_silent();
  int taken = 0;
  for (int i = 0; i < 30; ++i) {
    taken += bus.send(counting(1000)) ? 1 : 0;
    bus.run(10);
  }
  EXPECT_GE(taken, 10);
  EXPECT_LE(taken, 13);  // two frames of the bus are on their way
  EXPECT_EQ(bus.host.down().counters().submissions_dropped, static_cast<std::uint64_t>(30 - taken));
  EXPECT_LE(*std::max_element(bus.record_bytes.begin() + 60, bus.record_bytes.end()), 2048u);
}

TEST(UsbHost, RefusesNonsense) {
  EXPECT_THROW(UsbHost(0), std::invalid_argument);
  EXPECT_THROW(UsbHost(1, {.errors = {{.direction = 2, .chance = 0.1}}}), std::invalid_argument);
  EXPECT_THROW(UsbHost(1, {.errors = {{.direction = 0, .chance = 1.0}}}), std::invalid_argument);
  Bus bus;
  bus.open();
  EXPECT_THROW((void)bus.host.up().submit(counting(1), bus.tick - 1), std::invalid_argument);
  EXPECT_THROW((void)bus.host.up().submit(Bytes{0x11, 1, 0}, bus.tick), std::runtime_error);
  Bus unasked;
  unasked.open();
  unasked.host.set_refused(true);
  unasked.run(5);
  EXPECT_THROW((void)unasked.host.up().submit(Bytes{0x90, 1, 0}, unasked.tick), std::runtime_error);
}

}  // namespace
}  // namespace palpate::link
