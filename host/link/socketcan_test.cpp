// Wants buses: PALPATE_TEST_CAN names a CAN interface that is up and takes CAN FD, and on which every frame
// reaches every socket of this computer (a virtual one). hil_tests/test_linux_guest.py has one.
#include "host/link/socketcan.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "host/link/can_testing.hpp"

namespace palpate::link {
namespace {

using testing::Bytes;
using testing::counting;
using testing::kPatience;
using testing::message_of;
using testing::PlainSocket;
using testing::read_all;
using testing::record;

class SocketCanTest : public testing::OnInterface {
 protected:
  SocketCanTest() : OnInterface("PALPATE_TEST_CAN") {}
  static void shell(const std::string& command) { ASSERT_EQ(std::system(command.c_str()), 0) << command; }
};

TEST_F(SocketCanTest, FramesOfEveryLengthCrossAsTheyAre) {
  for (const bool fd : {false, true}) {
    const std::string address = (fd ? "canfd:" : "can:") + interface();
    const auto a = open_transport(address), b = open_transport(address);
    EXPECT_EQ(a->address(), address);
    Bytes sent;
    std::uint32_t identifier = 0x1FFFFFFF;
    for (const std::size_t length : wire::kCanDataLengths) {
      if (!fd && length > 8) break;
      const Bytes one = record(identifier, counting(length, 0xF0), fd);
      identifier -= 0x1234567;
      ASSERT_TRUE(a->write(one));
      sent.insert(sent.end(), one.begin(), one.end());
    }
    EXPECT_EQ(read_all(*b, sent.size()), sent);
    ASSERT_TRUE(b->write(sent));  // many records at once
    EXPECT_EQ(read_all(*a, sent.size()), sent);
    EXPECT_EQ(a->counters().bytes_sent, sent.size());
    EXPECT_EQ(a->counters().bytes_received, sent.size());
    EXPECT_EQ(a->counters().frames_unsent, 0u);
    EXPECT_TRUE(a->read(std::chrono::microseconds(0)).empty());  // its own frames do not come back
  }
}

TEST_F(SocketCanTest, AnotherProgramSeesTheFramesOfTheKernel) {
  PlainSocket other(interface());
  const auto link = open_transport("can:" + interface() + ",fd");
  EXPECT_EQ(link->address(), "canfd:" + interface());
  ASSERT_TRUE(link->write(record(0x107D552A, counting(5), false)));
  ssize_t size = 0;
  canfd_frame frame = other.receive(size);
  EXPECT_EQ(size, static_cast<ssize_t>(CAN_MTU));
  EXPECT_EQ(frame.can_id, 0x107D552A | CAN_EFF_FLAG);
  EXPECT_EQ(Bytes(frame.data, frame.data + frame.len), counting(5));
  ASSERT_TRUE(link->write(record(0x1, counting(64), true)));
  frame = other.receive(size);
  EXPECT_EQ(size, static_cast<ssize_t>(CANFD_MTU));
  EXPECT_EQ(frame.can_id, 0x1 | CAN_EFF_FLAG);
  EXPECT_EQ(frame.flags & CANFD_BRS, CANFD_BRS);  // the data at the data bit rate
  EXPECT_EQ(Bytes(frame.data, frame.data + frame.len), counting(64));
}

// 11-bit identifiers and remote requests are other protocols'; an FD frame of an odd length is filled up.
TEST_F(SocketCanTest, TakesOnlyWhatRecordsCanSay) {
  PlainSocket other(interface());
  const auto link = open_transport("canfd:" + interface()), classic = open_transport("can:" + interface());
  other.send(0x123, counting(8), false);
  other.send(0x123 | CAN_EFF_FLAG | CAN_RTR_FLAG, {}, false);
  other.send(0x123 | CAN_EFF_FLAG, counting(10), true);
  other.send(0x124 | CAN_EFF_FLAG, counting(3), false);
  Bytes filled = counting(10);
  filled.resize(12);
  Bytes expected = record(0x123, filled, true);
  const Bytes last = record(0x124, counting(3), false);
  expected.insert(expected.end(), last.begin(), last.end());
  EXPECT_EQ(read_all(*link, expected.size()), expected);
  EXPECT_EQ(read_all(*classic, last.size()), last);
}

TEST_F(SocketCanTest, RefusesWhatIsNoRecordOrNotOfItsFormat) {
  const auto link = open_transport("can:" + interface());
  const Bytes good = record(0x123, counting(8), false);
  EXPECT_THROW(link->write(counting(20)), std::invalid_argument);
  EXPECT_THROW(link->write(std::span(good).first(good.size() - 1)), std::invalid_argument);
  EXPECT_THROW(link->write(record(0x123, counting(8), true)), std::invalid_argument);
  EXPECT_TRUE(link->write(good));
  EXPECT_EQ(link->counters().bytes_sent, good.size());
}

// What came while nobody read waits in order, or is missing and counted.
TEST_F(SocketCanTest, CountsWhatALateReaderMisses) {
  SocketCan late(interface(), wire::CanFormat::classic);
  const auto other = open_transport("can:" + interface());
  constexpr std::uint32_t kFrames = 20'000;
  for (std::uint32_t i = 0; i < kFrames; ++i) ASSERT_TRUE(other->write(record(i, {}, false)));
  std::uint32_t received = 0, next = 0;
  wire::CanRecordReader reader;
  const auto take_all = [&] {
    for (Bytes some; !(some = late.read(std::chrono::microseconds(0))).empty();) {
      std::span<const std::uint8_t> rest = some;
      for (auto step = reader.read(rest); step.found == wire::CanRecordReader::Found::frame;
           rest = rest.subspan(step.consumed), step = reader.read(rest)) {
        EXPECT_GE(step.frame.identifier, next);
        next = step.frame.identifier + 1;
        ++received;
        if (step.consumed == rest.size()) break;
      }
    }
  };
  take_all();
  // The kernel says with the next frame how many it has dropped.
  ASSERT_TRUE(other->write(record(kFrames, {}, false)));
  take_all();
  EXPECT_GT(late.errors().frames_missed, 0u);
  EXPECT_EQ(received + late.errors().frames_missed, kFrames + 1);
}

TEST_F(SocketCanTest, SaysWhatAnInterfaceLacks) {
  EXPECT_NE(message_of("can:lo").find("lo is no CAN interface"), std::string::npos);
  shell("ip link add dev vcan_lacks type vcan && ip link set vcan_lacks mtu 16");
  EXPECT_NE(message_of("can:vcan_lacks")
                .find("can:vcan_lacks: the interface is down; as root: ip link set vcan_lacks up"),
            std::string::npos);
  shell("ip link set vcan_lacks up");
  EXPECT_EQ(message_of("can:vcan_lacks"), "");
  EXPECT_NE(message_of("canfd:vcan_lacks").find("classic CAN only"), std::string::npos);
  shell("ip link del vcan_lacks");
  EXPECT_NE(message_of("can:vcan_lacks").find("No such device"), std::string::npos);
}

// Down, then up again: gone for both, opened anew. Unplugged: the same.
TEST_F(SocketCanTest, AnInterfaceThatGoesAwayClosesTheLink) {
  for (const std::string gone : {"ip link set vcan_goes down", "ip link del vcan_goes"}) {
    shell("ip link add dev vcan_goes type vcan 2>/dev/null; ip link set vcan_goes up");
    SocketCan reads(open_transport("can:vcan_goes") ? "vcan_goes" : "", wire::CanFormat::classic);
    const auto writes = open_transport("can:vcan_goes");
    std::thread waiting([&reads] { EXPECT_TRUE(reads.read(kPatience).empty()); });
    shell(gone);
    waiting.join();
    EXPECT_FALSE(reads.is_open()) << gone;
    EXPECT_FALSE(writes->write(record(1, {}, false))) << gone;
    EXPECT_FALSE(writes->is_open()) << gone;
    EXPECT_EQ(writes->counters().frames_unsent, 1u);
  }
}

// A number for the documentation, no assertion: what the machine does meanwhile is in it.
TEST_F(SocketCanTest, RoundTrips) {
  for (const bool fd : {false, true}) {
    const std::string address = (fd ? "canfd:" : "can:") + interface();
    const auto near = open_transport(address), far = open_transport(address);
    const Bytes one = record(0x100, counting(fd ? 64 : 8), fd);
    constexpr int kTrips = 2000;
    std::thread echo([&] {
      for (int i = 0; i < kTrips; ++i) far->write(read_all(*far, one.size()));
    });
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < kTrips; ++i) {
      ASSERT_TRUE(near->write(one));
      ASSERT_EQ(read_all(*near, one.size()), one);
    }
    const std::chrono::duration<double> took_s = std::chrono::steady_clock::now() - start;
    echo.join();
    std::printf("measured: %s, %zu bytes of data: %.0f round trips a second\n", address.c_str(),
                fd ? std::size_t{64} : std::size_t{8}, kTrips / took_s.count());
  }
}

}  // namespace
}  // namespace palpate::link
