// The whole loop over a CAN bus that both directions share, its board the firmware in memory, built for CAN.
// One program for classic CAN and one for CAN FD (firmware/link/framing.hpp).

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "host/link/can_bus.hpp"
#include "host/link/can_cost.hpp"
#include "host/link/can_record_bytes.hpp"
#include "host/session/closed_loop.hpp"
#include "host/session/test_board.hpp"
#include "host/session/test_drag.hpp"

namespace palpate::host {
namespace {

constexpr bool kFd = std::is_same_v<firmware::LinkFraming, firmware::CanFdFraming>;
static_assert(kFd || std::is_same_v<firmware::LinkFraming, firmware::ClassicCanFraming>);

struct Outcome {
  ClosedLoopResult result;
  link::MediumCounters down, up;
  std::optional<palpate_BoardStatus_1_0> status;
};

// A third node fills the bus with what goes before all else: seven frames of 8 bytes at the first priority
// take 1.1 ticks at 1 Mbit/s.
void babble(link::MeteredCanBus& bus, std::uint32_t tick) {
  constexpr std::uint32_t kMessage = 0x0060'0000u | (7000u << 8) | 99u;
  constexpr std::array<std::uint8_t, 8> kData{1, 2, 3, 4, 5, 6, 7, 0xe0};
  for (int i = 0; i < 7; ++i) {
    const std::vector<std::uint8_t> record =
        link::can_record_of({.identifier = kMessage, .fd = false, .data = kData});
    ASSERT_TRUE(bus.down().submit(record, tick));
  }
}

// Pressed into a block and dragged over two of its cells; `lost_from` to `lost_until`: the cable is out, or
// another node babbles.
Outcome run(std::uint32_t ticks, std::uint32_t lost_from, std::uint32_t lost_until, bool babbles = false) {
  const Body body = test::drag_body();
  constexpr std::uint32_t kHostDelay_ticks = 5;
  ClosedLoopConfig config = test::drag_config(ticks, kHostDelay_ticks, {TraceForm::tip, 4});
  config.framing = kFd ? link::FramingKind::can_fd : link::FramingKind::can_classic;
  plant::Plant plant = test::drag_plant(-0.016);
  test::MemoryPeer board;
  link::MeteredCanBus bus(kFd ? link::kCanFd_5_Mbit : link::kClassicCan_1_Mbit);
  ClosedLoop loop(body, body.rest_state(), plant, board, bus.down(), bus.up(), config);
  std::vector<LoopTick> recorded;
  while (loop.tick() < ticks) {
    const bool is_lost = loop.tick() >= lost_from && loop.tick() < lost_until;
    loop.set_unplugged(is_lost && !babbles);
    if (is_lost && babbles) babble(bus, loop.tick());
    recorded.push_back(loop.advance());
  }
  Outcome outcome{.result = {},
                  .down = bus.down().counters(),
                  .up = bus.up().counters(),
                  .status = loop.host().board_status()};
  outcome.result = loop.host().finish(std::move(recorded));
  loop.shut_down();
  EXPECT_TRUE(board.has_shut_down());
  return outcome;
}

constexpr std::uint32_t kTicks = 3000;  // on classic CAN a basis takes more than one second

// Nothing is lost, bases cross in what states leave, and models are in use; the bus is what it costs by
// computation, never more than all of it.
TEST(ClosedLoopOverCan, ModelsCrossAndNothingIsLost) {
  const Outcome outcome = run(kTicks, kTicks, kTicks);
  const ClosedLoopResult& result = outcome.result;
  ASSERT_TRUE(outcome.status.has_value());
  EXPECT_EQ(result.counters.frames_lost_up, 0u);
  EXPECT_EQ(result.counters.frames_lost_down, 0u);
  EXPECT_EQ(result.counters.frames_repeated_up, 0u);
  EXPECT_EQ(outcome.status->frames_refused, 0u);
  EXPECT_EQ(outcome.status->frames_unsent, 0u);
  EXPECT_EQ(outcome.down.bytes_dropped + outcome.up.bytes_dropped, 0u);
  EXPECT_EQ(outcome.status->mode, palpate_BoardStatus_1_0_MODE_RENDER);
  EXPECT_GE(result.counters.models_taken, kFd ? 60u : 20u);
  for (const UpdateRecord& update : result.updates) EXPECT_EQ(update.interpolated_ticks, 0u);
  const double busy_ticks = outcome.down.busy_ticks + outcome.up.busy_ticks;
  EXPECT_LT(busy_ticks, kTicks);
  EXPECT_GT(busy_ticks, 0.05 * kTicks);
  RecordProperty("bus_share", std::to_string(busy_ticks / kTicks));
  RecordProperty("models_taken", std::to_string(result.counters.models_taken));
  float largest_force_N = 0;
  for (const LoopTick& tick : result.ticks)
    largest_force_N = std::max(largest_force_N, std::abs(tick.board.force_N[2]));
  EXPECT_GT(largest_force_N, 0.1f);  // the body is felt
}

// With the cable out for 100 ticks transfers are cut off on the way: losses are counted on both sides, ticks
// that are missing are asked for, and models are taken again.
TEST(ClosedLoopOverCan, GoesOnBehindAnInterruption) {
  constexpr std::uint32_t kFrom = kTicks - 800, kUntil = kFrom + 100;
  const Outcome outcome = run(kTicks, kFrom, kUntil);
  ASSERT_TRUE(outcome.status.has_value());
  EXPECT_GT(outcome.result.counters.frames_lost_up, 0u);
  EXPECT_GT(outcome.result.counters.frames_lost_down, 0u);
  EXPECT_EQ(outcome.status->mode, palpate_BoardStatus_1_0_MODE_RENDER);
  ASSERT_FALSE(outcome.result.updates.empty());
  EXPECT_GT(outcome.result.updates.back().sent_tick, kUntil + 300);
  EXPECT_EQ(outcome.result.updates.back().interpolated_ticks, 0u);
}

// Nothing else crosses while it lasts: to the board the link is lost. It is damped, suspended, and goes on by
// itself with the first model afterwards (docs/safety.md, "A lost link").
TEST(ClosedLoopOverCan, ABabblingNodeIsALostLink) {
  constexpr std::uint32_t kFrom = 1800, kUntil = kFrom + 1700;
  constexpr std::uint32_t kAfter = kFd ? 1500 : 3500;  // on classic CAN a basis has to cross first
  const Outcome outcome = run(kUntil + kAfter, kFrom, kUntil, true);
  const firmware::Limits limits;
  bool was_suspended = false;
  std::array<float, 3> before_N{};
  for (const LoopTick& tick : outcome.result.ticks) {
    const auto mode = static_cast<firmware::Mode>(tick.board.mode);
    was_suspended = was_suspended || mode == firmware::Mode::suspended;
    EXPECT_EQ(tick.board.faults, 0u);
    const auto& force_N = tick.board.force_N;
    if (tick.board.enabled != 0) {
      EXPECT_LE(std::hypot(force_N[0] - before_N[0], force_N[1] - before_N[1], force_N[2] - before_N[2]),
                limits.force_step_N + 1e-5f);  // of float's rounding
    }
    before_N = force_N;
  }
  EXPECT_TRUE(was_suspended);
  ASSERT_TRUE(outcome.status.has_value());
  EXPECT_EQ(outcome.status->mode, palpate_BoardStatus_1_0_MODE_RENDER);
  const auto& updates = outcome.result.updates;
  EXPECT_TRUE(std::any_of(updates.begin(), updates.end(),
                          [](const UpdateRecord& update) { return update.swap_tick > kUntil; }));
}

}  // namespace
}  // namespace palpate::host
