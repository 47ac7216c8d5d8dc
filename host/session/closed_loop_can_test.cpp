// The whole loop over a CAN bus that both directions share, its board the firmware in memory, built for CAN.
// One program for classic CAN and one for CAN FD (firmware/link/framing.hpp).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "host/link/can_bus.hpp"
#include "host/link/can_cost.hpp"
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

// Pressed into a block and dragged over two of its cells; `lost_from` to `lost_until`: the cable is out.
Outcome run(std::uint32_t ticks, std::uint32_t lost_from, std::uint32_t lost_until) {
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
    loop.set_unplugged(loop.tick() >= lost_from && loop.tick() < lost_until);
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

}  // namespace
}  // namespace palpate::host
