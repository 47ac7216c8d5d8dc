#include "host/link/uart.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <stdexcept>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes counting(std::size_t length) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

// Bytes of a burst submitted at `submitted` that have arrived by `tick`: one in 10 bit times, floor(ms * baud
// / 10,000).
std::size_t closed_form(std::uint32_t baud, std::uint32_t submitted, std::uint32_t tick, std::size_t length) {
  const std::uint64_t elapsed = tick - submitted;
  return std::min<std::size_t>(elapsed * baud / 10'000, length);
}

TEST(Uart, EveryByteArrivesWhenItShould) {
  for (const std::uint32_t baud :
       {9600u, 57600u, 115200u, 230400u, 921600u, 1'000'000u, 3'000'000u, 12'000'000u}) {
    Uart uart(baud, baud);
    constexpr std::uint32_t kStart = 17;
    const Bytes sent = counting(baud / 10);  // one second's worth
    ASSERT_TRUE(uart.submit(sent, kStart));
    Bytes received;
    for (std::uint32_t tick = kStart; tick <= kStart + kTicksPerSecond; ++tick) {
      const Bytes got = uart.deliver(tick);
      received.insert(received.end(), got.begin(), got.end());
      ASSERT_EQ(received.size(), closed_form(baud, kStart, tick, sent.size()))
          << baud << " baud, tick " << tick;
      ASSERT_EQ(uart.backlog_bytes(tick), sent.size() - received.size());
    }
    EXPECT_EQ(received, sent);
    EXPECT_DOUBLE_EQ(uart.counters().busy_ticks, kTicksPerSecond);  // the line never paused
  }
}

// A pause starts the next byte at its tick; without one, bytes of different submissions follow back to back.
TEST(Uart, PausesAndQueueing) {
  Uart uart(115'200);  // 11.52 bytes a tick
  EXPECT_TRUE(uart.submit(Bytes(5, 1), 0));
  EXPECT_EQ(uart.deliver(1).size(), 5u);
  EXPECT_TRUE(uart.submit(Bytes(12, 2), 3));
  EXPECT_TRUE(uart.submit(Bytes(23, 3), 3));
  EXPECT_EQ(uart.deliver(3).size(), 0u);
  EXPECT_EQ(uart.deliver(4).size(), 11u);
  EXPECT_TRUE(uart.submit(Bytes(1, 4), 4));  // behind the 35 of tick 3: the 36th byte needs 3.125 ticks
  EXPECT_EQ(uart.deliver(5).size(), 12u);
  EXPECT_EQ(uart.deliver(6).size(), 11u);
  EXPECT_EQ(uart.backlog_bytes(6), 2u);
  EXPECT_EQ(uart.deliver(7), (Bytes{3, 4}));
  EXPECT_EQ(uart.deliver(100).size(), 0u);
  EXPECT_DOUBLE_EQ(uart.counters().busy_ticks, 41 / 11.52);
}

// An hour of saturated line at a rate that is no whole number of bytes a tick: not a byte too early, late,
// lost or out of order.
TEST(Uart, NoDriftAndNoLoss) {
  constexpr std::uint32_t kBaud = 115'201, kLast = 3'600'000;
  Uart uart(kBaud);
  std::uint8_t next_out = 0, next_in = 0;  // bytes count up
  std::uint64_t received = 0;
  for (std::uint32_t tick = 0; tick <= kLast; tick += 50) {
    for (const std::uint8_t byte : uart.deliver(tick)) ASSERT_EQ(byte, next_in++);
    received = uart.counters().bytes_delivered;
    ASSERT_EQ(received, std::uint64_t{tick} * kBaud / 10'000) << tick;
    while (uart.backlog_bytes(tick) < 1000) {
      Bytes burst(600);
      for (std::uint8_t& byte : burst) byte = next_out++;
      ASSERT_TRUE(uart.submit(burst, tick));
    }
  }
  EXPECT_EQ(uart.counters().bytes_dropped, 0u);
  EXPECT_GT(received, 41'000'000u);
}

// However the bytes are cut into submissions and deliveries, what has arrived by a tick is the same.
TEST(Uart, CuttingDoesNotMatter) {
  std::mt19937 random(1);
  Uart whole(921'600), pieces(921'600);
  Bytes from_whole, from_pieces;
  const auto append = [](Bytes& to, const Bytes& bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); };
  for (std::uint32_t tick = 0; tick < 500; ++tick) {
    append(from_pieces, pieces.deliver(tick));
    if (tick % 50 == 0) {
      append(from_whole, whole.deliver(tick));
      ASSERT_EQ(from_whole, from_pieces) << tick;
    }
    if (tick % 7 == 0) {
      const Bytes bytes = counting(random() % 1200);
      ASSERT_TRUE(whole.submit(bytes, tick));
      for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t length = std::min<std::size_t>(1 + random() % 50, bytes.size() - at);
        ASSERT_TRUE(pieces.submit(std::span(bytes).subspan(at, length), tick));
        at += length;
      }
    }
  }
}

TEST(Uart, FullQueueDropsWholeSubmissionsAndCountsThem) {
  Uart uart(1'000'000, 250);  // 100 bytes a tick
  EXPECT_TRUE(uart.submit(Bytes(200, 1), 0));
  EXPECT_FALSE(uart.submit(Bytes(51, 2), 0));
  EXPECT_TRUE(uart.submit(Bytes(50, 3), 0));
  EXPECT_FALSE(uart.submit(Bytes(101, 4), 1));
  EXPECT_TRUE(uart.submit(Bytes(100, 5), 1));
  Bytes expected(350);
  for (std::size_t i = 0; i < expected.size(); ++i) expected[i] = i < 200 ? 1 : i < 250 ? 3 : 5;
  EXPECT_EQ(uart.deliver(10), expected);
  const MediumCounters counters = uart.counters();
  EXPECT_EQ(counters.submissions_dropped, 2u);
  EXPECT_EQ(counters.bytes_dropped, 152u);
  EXPECT_EQ(counters.bytes_accepted, 350u);
  EXPECT_EQ(counters.bytes_delivered, 350u);
}

TEST(Uart, RefusesWhatMakesNoSense) {
  EXPECT_THROW(Uart(kMinBaud - 1), std::invalid_argument);
  EXPECT_THROW(Uart(kMaxBaud + 1), std::invalid_argument);
  EXPECT_THROW(Uart(115'200, 0), std::invalid_argument);
  Uart uart(115'200);
  EXPECT_TRUE(uart.submit(Bytes(1, 0), 5));
  EXPECT_THROW(uart.submit(Bytes(1, 0), 4), std::invalid_argument);
  EXPECT_THROW(uart.deliver(4), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::link
