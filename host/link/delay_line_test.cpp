#include "host/link/delay_line.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Each submission with the tick in which it came.
std::vector<std::uint32_t> arrivals(DelayLine& line, std::uint32_t ticks) {
  std::vector<std::uint32_t> when(ticks, 0);
  for (std::uint32_t tick = 0; tick < 2 * ticks; ++tick) {
    if (tick < ticks) line.submit(Bytes(1, static_cast<std::uint8_t>(tick)), tick);
    line.deliver(tick, [&](const Bytes& bytes) { when[bytes.front()] = tick; });
  }
  return when;
}

TEST(DelayLine, WithoutDelaysBytesPassAtOnce) {
  DelayLine line;
  const auto when = arrivals(line, 100);
  for (std::uint32_t tick = 0; tick < 100; ++tick) EXPECT_EQ(when[tick], tick);
}

TEST(DelayLine, DelaysInItsTicksAndKeepsTheOrder) {
  DelayLine line({Delay{.delay_ticks = 20, .first_tick = 10, .end_tick = 50}}, 1);
  const auto when = arrivals(line, 100);
  EXPECT_EQ(when[9], 9u);
  for (std::uint32_t tick = 10; tick < 50; ++tick) EXPECT_EQ(when[tick], tick + 20);
  for (std::uint32_t tick = 50; tick < 70; ++tick) EXPECT_EQ(when[tick], 69u);
  EXPECT_EQ(when[70], 70u);
  EXPECT_EQ(line.delayed(), 59u);  // what comes at 69 passes at once
}

TEST(DelayLine, JitterIsDrawnNeverOvertakesAndNeverExceeds) {
  DelayLine line({Delay{.jitter_ticks = 30}}, 3);
  const auto when = arrivals(line, 200);
  std::uint32_t latest = 0, largest = 0;
  for (std::uint32_t tick = 0; tick < 200; ++tick) {
    EXPECT_GE(when[tick], latest);
    EXPECT_LE(when[tick] - tick, 30u);
    latest = when[tick];
    largest = std::max(largest, when[tick] - tick);
  }
  EXPECT_GT(largest, 20u);
}

}  // namespace
}  // namespace palpate::link
