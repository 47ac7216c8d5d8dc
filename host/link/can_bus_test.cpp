#include "host/link/can_bus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "host/link/can_record_bytes.hpp"
#include "host/link/framing.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kUrgent = 0x0C66402Au, kMiddle = 0x10664A0Au, kLast = 0x14664C0Au;

Bytes record(std::uint32_t identifier, std::size_t data_bytes, bool fd = false, std::uint8_t fill = 0) {
  const Bytes data(data_bytes, fill);
  return can_record_of({identifier, fd, data});
}

Bytes times(const Bytes& bytes, std::size_t count) {
  Bytes out;
  for (std::size_t i = 0; i < count; ++i) out.insert(out.end(), bytes.begin(), bytes.end());
  return out;
}

struct Seen {
  std::uint32_t identifier = 0;
  std::uint8_t fill = 0;
  bool operator==(const Seen&) const = default;
};

std::vector<Seen> seen(const Bytes& bytes) {
  wire::CanRecordReader reader;
  std::vector<Seen> frames;
  std::span<const std::uint8_t> rest(bytes);
  while (true) {
    const wire::CanRecordReader::Step step = reader.read(rest);
    rest = rest.subspan(step.consumed);
    if (step.found == wire::CanRecordReader::Found::nothing) return frames;
    EXPECT_EQ(step.found, wire::CanRecordReader::Found::frame);
    frames.push_back({step.frame.identifier, step.frame.data.empty() ? std::uint8_t{0} : step.frame.data[0]});
  }
}

// A full classic frame takes 160 us (can_cost_test.cpp): of a queue that never empties, floor(6.25 k) have
// arrived k ticks on. A minute of it.
TEST(MeteredCanBus, EveryFrameArrivesWhenItShould) {
  MeteredCanBus bus(kClassicCan_1_Mbit);
  const Bytes one = record(kMiddle, 8);
  std::size_t submitted = 0, arrived = 0;
  constexpr std::uint32_t kStart = 17, kEnd = kStart + 60'000;
  for (std::uint32_t tick = kStart; tick <= kEnd; ++tick) {
    arrived += bus.down().deliver(tick).size() / one.size();
    ASSERT_EQ(arrived, std::uint64_t{tick - kStart} * 25 / 4) << tick;
    ASSERT_EQ(bus.down().backlog_bytes(tick), (submitted - arrived) * one.size());
    for (; submitted < arrived + 20; ++submitted) ASSERT_TRUE(bus.down().submit(one, tick));
  }
  EXPECT_NEAR(bus.down().counters().busy_ticks, kEnd - kStart, 1e-6);
  EXPECT_EQ(bus.down().counters().bytes_dropped, 0u);
}

// A transfer alone on the bus takes what can_cost.hpp says: it is there at the first tick after that.
TEST(MeteredCanBus, TransfersTakeTheirComputedTime) {
  for (const bool fd : {false, true}) {
    const CanBus rates = fd ? kCanFd_5_Mbit : kClassicCan_1_Mbit;
    const auto framing = make_framing(fd ? FramingKind::can_fd : FramingKind::can_classic);
    for (std::size_t length = 0; length <= 1448; length += 13) {
      MeteredCanBus bus(rates);
      const Bytes bytes = framing->encode({.source = 10, .specifier = 1610}, Bytes(length, 0x5A));
      const double ticks = can_transfer_s(rates, length) * kTicksPerSecond;
      ASSERT_TRUE(bus.up().submit(bytes, 0));
      Bytes got;
      std::uint32_t tick = 0;
      for (; got.size() < bytes.size(); ++tick) {
        const Bytes more = bus.up().deliver(tick);
        got.insert(got.end(), more.begin(), more.end());
      }
      ASSERT_EQ(got, bytes);
      ASSERT_EQ(tick - 1, static_cast<std::uint32_t>(std::ceil(ticks - 1e-9))) << length;
      // As many frames as it takes, each rounded to 1 ns.
      ASSERT_NEAR(bus.up().counters().busy_ticks, ticks, 1e-3);
    }
  }
}

// Both directions together get what one alone would, and the least identifier goes first, whoever sends it
// and in whatever order the frames were handed over.
TEST(MeteredCanBus, DirectionsShareOneBus) {
  MeteredCanBus bus(kClassicCan_1_Mbit);
  ASSERT_TRUE(bus.down().submit(times(record(kMiddle, 8), 10), 0));
  ASSERT_TRUE(bus.up().submit(times(record(kUrgent, 8), 10), 0));
  ASSERT_TRUE(bus.down().submit(times(record(kLast, 8), 10), 0));
  EXPECT_EQ(seen(bus.up().deliver(1)).size(), 6u);
  EXPECT_TRUE(bus.down().deliver(1).empty());
  EXPECT_EQ(seen(bus.up().deliver(2)).size(), 4u);
  EXPECT_EQ(seen(bus.down().deliver(2)), (std::vector<Seen>{{kMiddle, 0}, {kMiddle, 0}}));
  const std::vector<Seen> rest = seen(bus.down().deliver(5));
  ASSERT_EQ(rest.size(), 18u);  // 30 frames take 4.8 ticks
  EXPECT_TRUE(std::is_sorted(rest.begin(), rest.end(),
                             [](const Seen& a, const Seen& b) { return a.identifier < b.identifier; }));
  EXPECT_NEAR(bus.up().counters().busy_ticks + bus.down().counters().busy_ticks, 4.8, 1e-9);
}

// An urgent frame waits for the one on its way, and for no other; frames of one identifier keep their order.
TEST(MeteredCanBus, FramesOnTheirWayAreNotInterrupted) {
  MeteredCanBus bus(kClassicCan_1_Mbit);
  Bytes queue;
  for (std::uint8_t i = 0; i < 12; ++i) {
    const Bytes one = record(kLast, 8, false, i);
    queue.insert(queue.end(), one.begin(), one.end());
  }
  ASSERT_TRUE(bus.down().submit(queue, 0));
  // At tick 1 the 7th is on its way, until 1.12 ms.
  ASSERT_TRUE(bus.up().submit(record(kUrgent, 8), 1));
  EXPECT_EQ(bus.up().deliver(2).size(), record(kUrgent, 8).size());  // 1.28 ms
  const std::vector<Seen> down = seen(bus.down().deliver(2));
  ASSERT_EQ(down.size(), 11u);  // of 12 in all that fit in 2 ms, less the urgent one
  for (std::uint8_t i = 0; i < 11; ++i) EXPECT_EQ(down[i], (Seen{kLast, i}));
}

// Frames of the same tick compete in the same way, whatever the order of the calls.
TEST(MeteredCanBus, OrderOfCallsDoesNotMatter) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    MeteredCanBus a(kClassicCan_1_Mbit), b(kClassicCan_1_Mbit);
    for (std::uint32_t tick = 0; tick < 40; ++tick) {
      Bytes down_a = a.down().deliver(tick), up_a = a.up().deliver(tick);
      Bytes up_b = b.up().deliver(tick), down_b = b.down().deliver(tick);
      ASSERT_EQ(down_a, down_b);
      ASSERT_EQ(up_a, up_b);
      const Bytes down = times(
          record(kMiddle + 256 * static_cast<std::uint32_t>(random() % 4), 1 + random() % 8), random() % 8);
      const Bytes up =
          times(record(kUrgent + 256 * static_cast<std::uint32_t>(random() % 4), random() % 9), random() % 8);
      ASSERT_TRUE(a.down().submit(down, tick) && a.up().submit(up, tick));
      ASSERT_TRUE(b.up().submit(up, tick) && b.down().submit(down, tick));
      // Looking ahead changes nothing, and is right.
      const std::size_t later = a.up().backlog_bytes(tick + 1);
      ASSERT_EQ(later, b.up().backlog_bytes(tick + 1));
    }
  }
}

TEST(MeteredCanBus, BacklogAheadIsWhatWillBeLeft) {
  MeteredCanBus bus(kClassicCan_1_Mbit);
  const Bytes one = record(kMiddle, 8);
  ASSERT_TRUE(bus.down().submit(times(one, 20), 3));
  EXPECT_EQ(bus.down().backlog_bytes(4), 14 * one.size());
  EXPECT_EQ(bus.down().backlog_bytes(3), 20 * one.size());
  EXPECT_EQ(bus.up().backlog_bytes(4), 0u);
  EXPECT_EQ(bus.down().deliver(4).size(), 6 * one.size());
}

// By hand (can_cost_test.cpp): a frame of 64 bytes takes 192.8 us on CAN FD, one of classic format 160 us.
TEST(MeteredCanBus, FormatsOnABusForCanFd) {
  MeteredCanBus bus(kCanFd_5_Mbit);
  ASSERT_TRUE(bus.up().submit(times(record(kMiddle, 64, true), 100), 0));
  EXPECT_EQ(seen(bus.up().deliver(10)).size(), 51u);
  EXPECT_NEAR(bus.up().bytes_per_tick(), 71 / 0.1928, 1e-6);
  MeteredCanBus mixed(kCanFd_5_Mbit);
  ASSERT_TRUE(mixed.up().submit(times(record(kMiddle, 8), 100), 0));
  EXPECT_EQ(seen(mixed.up().deliver(10)).size(), 62u);
}

TEST(MeteredCanBus, RecordsInPieces) {
  MeteredCanBus bus(kClassicCan_1_Mbit);
  const Bytes one = record(kMiddle, 8);
  ASSERT_TRUE(bus.down().submit(std::span(one).first(7), 0));
  EXPECT_EQ(bus.down().backlog_bytes(0), 7u);
  EXPECT_TRUE(bus.down().deliver(5).empty());
  ASSERT_TRUE(bus.down().submit(std::span(one).subspan(7), 5));
  EXPECT_EQ(bus.down().deliver(6), one);
}

TEST(MeteredCanBus, WhatIsDroppedIsCounted) {
  const Bytes one = record(kMiddle, 8);
  MeteredCanBus full(kClassicCan_1_Mbit, 4 * one.size());
  EXPECT_TRUE(full.up().submit(times(one, 3), 0));
  EXPECT_FALSE(full.up().submit(times(one, 2), 0));
  EXPECT_TRUE(full.up().submit(one, 0));
  EXPECT_EQ(full.up().deliver(1).size(), 4 * one.size());
  EXPECT_EQ(full.up().counters().submissions_dropped, 1u);
  EXPECT_EQ(full.up().counters().bytes_dropped, 2 * one.size());
  EXPECT_EQ(full.up().counters().bytes_accepted, 4 * one.size());
  EXPECT_EQ(full.up().counters().bytes_delivered, 4 * one.size());

  MeteredCanBus classic(kClassicCan_1_Mbit);
  EXPECT_FALSE(classic.down().submit(record(kMiddle, 8, true), 0));
  EXPECT_EQ(classic.down().counters().bytes_dropped, one.size());
  Bytes stream = times(one, 7);
  stream[9] ^= 0x10;  // of the first
  EXPECT_FALSE(classic.down().submit(stream, 0));
  EXPECT_EQ(classic.down().deliver(1), times(one, 6));
  EXPECT_EQ(classic.down().counters().bytes_dropped, 2 * one.size());
}

TEST(MeteredCanBus, RefusesWhatMakesNoSense) {
  EXPECT_THROW(MeteredCanBus({.nominal_bit_s = 0.0}), std::invalid_argument);
  EXPECT_THROW(MeteredCanBus({.fd = true, .nominal_bit_s = 1e-6, .data_bit_s = -1.0}), std::invalid_argument);
  EXPECT_THROW(MeteredCanBus(kClassicCan_1_Mbit, 0), std::invalid_argument);
  MeteredCanBus bus(kClassicCan_1_Mbit);
  EXPECT_TRUE(bus.down().submit(record(kMiddle, 8), 5));
  EXPECT_THROW(bus.up().submit(record(kMiddle, 8), 4), std::invalid_argument);
  EXPECT_THROW(bus.down().deliver(4), std::invalid_argument);
}

// A session's traffic, both ways at once, interleaved frame by frame: every transfer arrives whole at the
// other end, urgent ones before others that were handed over with them.
TEST(MeteredCanBus, TransfersOfASessionArriveWhole) {
  for (const FramingKind kind : {FramingKind::can_classic, FramingKind::can_fd}) {
    std::mt19937 random(3);
    MeteredCanBus bus(kind == FramingKind::can_fd ? kCanFd_5_Mbit : kClassicCan_1_Mbit);
    const auto host = make_framing(kind), board = make_framing(kind);
    std::uint64_t sent_down = 0, sent_up = 0;
    const auto encode = [&random](const Framing& framing, std::uint16_t source, std::uint16_t subject,
                                  wire::Priority priority, std::uint64_t id, std::size_t bytes) {
      Bytes payload(bytes);
      for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(random() & 0xFF);
      return framing.encode({.priority = priority, .source = source, .specifier = subject, .transfer_id = id},
                            payload);
    };
    const auto take = [](Framing& framing, const Bytes& bytes, std::uint32_t tick) {
      std::span<const std::uint8_t> rest(bytes);
      while (true) {
        const wire::Reception reception = framing.receive(rest, tick);
        rest = rest.subspan(reception.consumed);
        if (!reception.complete) return;
      }
    };
    constexpr std::uint32_t kTicks = 3000, kQuiet = 500;
    for (std::uint32_t tick = 0; tick < kTicks + kQuiet; ++tick) {
      take(*board, bus.down().deliver(tick), tick);
      take(*host, bus.up().deliver(tick), tick);
      if (tick >= kTicks) continue;
      if (tick % 4 == 0) {
        bus.up().submit(
            encode(*board, wire::kBoardNode, wire::kTipTraceSubject, wire::Priority::nominal, sent_up++, 40),
            tick);
      }
      if (tick % 100 == 0) {
        bus.down().submit(encode(*host, wire::kHostNode, wire::kModelStateSubject, wire::Priority::nominal,
                                 sent_down++, 584),
                          tick);
        bus.down().submit(
            encode(*host, wire::kHostNode, wire::kModelPartSubject, wire::Priority::low, sent_down++, 267),
            tick);
      }
    }
    EXPECT_EQ(board->counters().frames, sent_down);
    EXPECT_EQ(host->counters().frames, sent_up);
    EXPECT_EQ(board->counters().refused(), 0u);
    EXPECT_EQ(host->counters().refused(), 0u);
  }
}

// Each frame arrives once and in its order; an attempt that an error hits costs the frame and 20 bits.
TEST(MeteredCanBus, AFrameThatAnErrorHitsGoesAgain) {
  constexpr std::uint8_t kFrames = 200;
  constexpr double kChance = 0.1, kFrame_ms = 0.160, kError_ms = 0.020;
  MeteredCanBus bus(kClassicCan_1_Mbit, 1u << 20,
                    {.errors = {{.direction = 0, .chance = kChance}}, .seed = 3});
  for (std::uint8_t i = 0; i < kFrames; ++i) ASSERT_TRUE(bus.down().submit(record(kMiddle, 8, false, i), 0));
  std::vector<Seen> got;
  std::uint32_t tick = 0;
  for (; got.size() < kFrames && tick < 1000; ++tick)
    for (const Seen& one : seen(bus.down().deliver(tick))) got.push_back(one);
  ASSERT_EQ(got.size(), kFrames);
  for (std::uint8_t i = 0; i < kFrames; ++i) EXPECT_EQ(got[i].fill, i);
  const MediumCounters counters = bus.down().counters();
  const auto failed = static_cast<double>(counters.attempts_failed);
  // Of n that went through: six standard deviations of the negative binomial distribution.
  EXPECT_NEAR(failed, kFrames * kChance / (1.0 - kChance),
              6.0 * std::sqrt(kFrames * kChance) / (1.0 - kChance));
  EXPECT_EQ(tick - 1, std::ceil(kFrames * kFrame_ms + failed * (kFrame_ms + kError_ms)));
  EXPECT_EQ(counters.bus_offs, 0u);
  EXPECT_EQ(counters.bytes_dropped, 0u);
}

// 32 errors in a row, and the sender is off the bus for 128 times 11 bits; the other direction is not. What
// waits goes when the errors are over.
TEST(MeteredCanBus, ASenderOfErrorsIsOffTheBusForAWhile) {
  constexpr std::uint32_t kUntil = 100;
  constexpr double kFrame_ms = 0.160, kError_ms = 0.020, kOff_ms = 1.408;
  const BusErrors errors{.errors = {{.direction = 0, .chance = 1.0 - 1e-9, .end_tick = kUntil}}, .seed = 1};
  MeteredCanBus bus(kClassicCan_1_Mbit, 1u << 20, errors);
  ASSERT_TRUE(bus.down().submit(record(kUrgent, 8), 0));
  for (std::uint32_t tick = 0; tick < kUntil; ++tick) {
    EXPECT_TRUE(bus.down().deliver(tick).empty());
    if (tick == 6) {
      // 32 attempts of 0.18 ms have ended at 5.76 ms: the bus is free for the other, less urgent one.
      EXPECT_EQ(bus.down().counters().bus_offs, 1u);
      ASSERT_TRUE(bus.up().submit(record(kLast, 8), tick));
    }
    EXPECT_EQ(bus.up().deliver(tick).empty(), tick != 7) << tick;
  }
  const MediumCounters counters = bus.down().counters();
  const double round_ms = 32.0 * (kFrame_ms + kError_ms) + kOff_ms;
  EXPECT_NEAR(static_cast<double>(counters.bus_offs), kUntil / round_ms, 1.0);
  EXPECT_NEAR(static_cast<double>(counters.attempts_failed), 32.0 * kUntil / round_ms, 32.0);
  EXPECT_FALSE(bus.down().deliver(kUntil + 3).empty());
}

// So many attempts of one direction, and no more: 31 in a row do not take it off the bus, 32 do.
TEST(MeteredCanBus, AttemptsThatAreToFailDo) {
  for (const std::uint64_t failing : {31u, 32u}) {
    MeteredCanBus bus(kClassicCan_1_Mbit);
    EXPECT_TRUE(bus.up().fail_attempts(failing));
    ASSERT_TRUE(bus.down().submit(record(kUrgent, 8), 0));
    ASSERT_TRUE(bus.up().submit(record(kMiddle, 8), 0));
    std::size_t down = 0, up = 0;
    for (std::uint32_t tick = 0; tick < 20; ++tick) {
      down += seen(bus.down().deliver(tick)).size();
      up += seen(bus.up().deliver(tick)).size();
    }
    EXPECT_EQ(down, 1u);
    EXPECT_EQ(up, 1u);
    EXPECT_EQ(bus.up().counters().attempts_failed, failing);
    EXPECT_EQ(bus.up().counters().bus_offs, failing == 32 ? 1u : 0u);
    EXPECT_EQ(bus.down().counters().attempts_failed, 0u);
  }
}

TEST(MeteredCanBus, RefusesErrorsThatAreNone) {
  for (const double chance : {-0.1, 1.0, std::nan("")})
    EXPECT_THROW(MeteredCanBus(kClassicCan_1_Mbit, 1000, {.errors = {{.direction = 0, .chance = chance}}}),
                 std::invalid_argument);
  EXPECT_THROW(MeteredCanBus(kClassicCan_1_Mbit, 1000, {.errors = {{.direction = 2, .chance = 0.5}}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace palpate::link
