// Wants a CAN FD controller with a bit timing of 1 and 5 Mbit/s, PALPATE_TEST_CAN_ADAPTER, and on its bus the
// node of hil_tests/gs_usb_adapter.py: it answers each frame with the next identifier and the data in
// reverse, and some frames make the controller tell of errors. hil_tests/test_linux_guest.py has them.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <span>
#include <thread>
#include <vector>

#include "host/link/can_cost.hpp"
#include "host/link/can_testing.hpp"
#include "host/link/socketcan.hpp"

namespace palpate::link {
namespace {

using testing::Bytes;
using testing::counting;
using testing::kPatience;
using testing::read_all;
using testing::record;

// As in gs_usb_adapter.py: what the controller tells when this frame passes.
constexpr std::uint32_t kBusOff = 0x1FFFFF00, kRestarted = 0x1FFFFF01,
                        kUnacknowledgedAndOverflow = 0x1FFFFF02, kLostArbitration = 0x1FFFFF03;

class SocketCanAdapterTest : public testing::OnInterface {
 protected:
  SocketCanAdapterTest() : OnInterface("PALPATE_TEST_CAN_ADAPTER") {}
};

Bytes answer_to(std::uint32_t identifier, Bytes data, bool fd) {
  std::reverse(data.begin(), data.end());
  return record(identifier + 1, data, fd);
}

// Lets the link take what the controller tells until this is so.
template <class Condition>
bool comes(Transport& link, Condition condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    link.read(std::chrono::milliseconds(1));
  }
  return true;
}

TEST_F(SocketCanAdapterTest, ANodeOnTheBusAnswersFramesOfEveryLength) {
  for (const bool fd : {false, true}) {
    const auto link = open_transport((fd ? "canfd:" : "can:") + interface());
    for (const std::size_t length : wire::kCanDataLengths) {
      if (!fd && length > 8) break;
      ASSERT_TRUE(link->write(record(0x1000 + 2 * static_cast<std::uint32_t>(length), counting(length), fd)));
      const Bytes expected = answer_to(0x1000 + 2 * static_cast<std::uint32_t>(length), counting(length), fd);
      EXPECT_EQ(read_all(*link, expected.size()), expected) << length;
    }
  }
}

TEST_F(SocketCanAdapterTest, KnowsWhatTheBusCarries) {
  constexpr double kClassic = (8 + wire::kCanRecordOverheadBytes), kFd = (64 + wire::kCanRecordOverheadBytes);
  EXPECT_DOUBLE_EQ(open_transport("can:" + interface())->bytes_per_s(),
                   kClassic / can_frame_s(kClassicCan_1_Mbit, 8));
  EXPECT_DOUBLE_EQ(open_transport("canfd:" + interface())->bytes_per_s(),
                   kFd / can_frame_s(kCanFd_5_Mbit, 64));
}

// Together the links have more frames on their way than queue and driver hold: the kernel refuses some
// (ENOBUFS). No more of them than the reader's socket holds, however slow it is.
TEST_F(SocketCanAdapterTest, WaitsWhereTheQueueIsFull) {
  constexpr std::uint32_t kLinks = 6, kFrames = 200, kOnTheirWay = 8;
  const auto reader = open_transport("canfd:" + interface());
  std::array<std::atomic<std::uint32_t>, kLinks> answered{};
  std::atomic<std::uint64_t> unsent{0};
  std::vector<std::jthread> writers;
  for (std::uint32_t writer = 0; writer < kLinks; ++writer)
    writers.emplace_back([&, writer](const std::stop_token& stop) {
      const auto link = open_transport("canfd:" + interface());
      // A machine that does other things may be slower than the link's patience: then the frame was not sent.
      for (std::uint32_t i = 0; i < kFrames && !stop.stop_requested();) {
        if (i < answered[writer] + kOnTheirWay) {
          if (link->write(record(writer << 16 | 2 * i, counting(8), true))) ++i;
        } else {
          std::this_thread::yield();
        }
      }
      unsent += link->counters().frames_unsent;
    });
  wire::CanRecordReader records;
  for (std::uint32_t answers = 0; answers < kLinks * kFrames;) {
    const Bytes some = reader->read(kPatience);
    ASSERT_FALSE(some.empty()) << answers;
    std::span<const std::uint8_t> rest = some;
    while (!rest.empty()) {
      const wire::CanRecordReader::Step step = records.read(rest);
      rest = rest.subspan(step.consumed);
      if (step.frame.identifier % 2 == 0) continue;  // a writer's own
      const std::uint32_t place = answered.at(step.frame.identifier >> 16)++;
      ASSERT_EQ(step.frame.identifier & 0xFFFFu, 2 * place + 1);
      ++answers;
    }
  }
  for (std::jthread& writer : writers) writer.join();
  // A link that does not wait gives up more often than there are frames (measured: 16,496 times for 1,200).
  EXPECT_LT(unsent, kLinks * kFrames);
}

TEST_F(SocketCanAdapterTest, CountsErrorsByKind) {
  SocketCan link(interface(), wire::CanFormat::classic);
  for (const std::uint32_t identifier :
       {kUnacknowledgedAndOverflow, kLostArbitration, kUnacknowledgedAndOverflow})
    ASSERT_TRUE(link.write(record(identifier, {}, false)));
  EXPECT_TRUE(comes(link, [&link] {
    const CanErrors errors = link.errors();
    return errors.unacknowledged == 2 && errors.lost_arbitrations == 1;
  }));
  EXPECT_EQ(link.errors().controller_overflows, 2u);
  EXPECT_EQ(link.errors().bus_offs, 0u);
  EXPECT_FALSE(link.is_bus_off());
}

TEST_F(SocketCanAdapterTest, OffTheBusItTakesNothingAndGoesOnWhenItIsBack) {
  SocketCan link(interface(), wire::CanFormat::classic);
  testing::PlainSocket other(interface());
  ASSERT_TRUE(link.write(record(kBusOff, {}, false)));
  ASSERT_TRUE(comes(link, [&link] { return link.is_bus_off(); }));
  EXPECT_TRUE(link.trouble().starts_with("off the bus now; bus-off 1")) << link.trouble();
  EXPECT_FALSE(link.write(record(0x100, counting(8), false)));
  EXPECT_EQ(link.counters().frames_unsent, 1u);
  EXPECT_TRUE(link.is_open());
  other.send(kRestarted | CAN_EFF_FLAG, {}, false);
  ASSERT_TRUE(comes(link, [&link] { return !link.is_bus_off(); }));
  EXPECT_TRUE(link.trouble().starts_with("bus-off 1")) << link.trouble();
  while (!link.read(std::chrono::microseconds(0)).empty()) continue;  // the other's frame
  ASSERT_TRUE(link.write(record(0x200, counting(8), false)));
  // What was refused has not been sent later: the answer is to this one.
  EXPECT_EQ(read_all(link, 14), answer_to(0x200, counting(8), false));
  EXPECT_EQ(link.errors().bus_offs, 1u);
  EXPECT_EQ(link.errors().restarts, 1u);
}

// A number for the report, no assertion.
TEST_F(SocketCanAdapterTest, RoundTrips) {
  for (const bool fd : {false, true}) {
    const auto link = open_transport((fd ? "canfd:" : "can:") + interface());
    const Bytes data = counting(fd ? 64 : 8), expected = answer_to(0x300, data, fd);
    constexpr int kTrips = 500;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < kTrips; ++i) {
      ASSERT_TRUE(link->write(record(0x300, data, fd)));
      ASSERT_EQ(read_all(*link, expected.size()), expected);
    }
    const std::chrono::duration<double> took_s = std::chrono::steady_clock::now() - start;
    std::printf("measured: %s, %zu bytes of data: %.0f round trips a second\n", link->address().c_str(),
                data.size(), kTrips / took_s.count());
  }
}

}  // namespace
}  // namespace palpate::link
