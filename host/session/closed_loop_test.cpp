// What the host hands to its link, and when, while bases cross: the whole loop in one process, its board the
// firmware in memory.

#include "host/session/closed_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include "host/link/can_cost.hpp"
#include "host/link/uart.hpp"
#include "host/session/test_board.hpp"
#include "host/session/test_contact.hpp"
#include "host/session/test_drag.hpp"
#include "host/session/test_line.hpp"

namespace palpate::host {
namespace {

// A frame that the host handed to its link.
struct Handed {
  std::uint32_t tick = 0;
  std::size_t bytes = 0, before_bytes = 0;  // what the link still carried then
  std::uint16_t specifier = 0;
  std::uint32_t basis_id = 0;  // of a state and of a piece
};

// A UART that remembers.
class Watched final : public test::WatchedLine {
 public:
  using WatchedLine::WatchedLine;
  bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) override {
    Handed one{.tick = tick, .bytes = bytes.size(), .before_bytes = backlog_bytes(tick)};
    const wire::Reception reception = receive(bytes);
    EXPECT_TRUE(reception.complete);  // a frame, whole
    one.specifier = reception.frame.header.specifier;
    if (one.specifier == wire::kModelStateSubject) {
      EXPECT_EQ(wire::deserialize(reception.frame.payload, state_), Status::ok);
      one.basis_id = state_.basis_id;
    } else if (one.specifier == wire::kModelPartSubject) {
      EXPECT_EQ(wire::deserialize(reception.frame.payload, part_), Status::ok);
      one.basis_id = part_.basis_id;
    }
    handed.push_back(one);
    return WatchedLine::submit(bytes, tick);
  }

  std::vector<Handed> handed;

 private:
  palpate_ModelState_1_0 state_{};
  palpate_ModelPart_1_0 part_{};
};

constexpr std::uint32_t kTicks = 1000, kHostDelay_ticks = 5;
constexpr std::size_t kBlock = palpate_ModelPart_1_0_BLOCK_BYTES;

std::size_t piece_payload_bytes() {
  palpate_ModelPart_1_0 part{};
  part.data.count = kBlock;
  return wire::payload_bytes(part);
}
const std::size_t kPieceFrame_bytes = wire::max_frame_bytes(piece_payload_bytes());

// A line on which a block of a basis takes as long as on CAN FD where all else has taken a tenth of that
// (host/session/can_traffic_test.cpp).
std::uint32_t can_fd_baud() {
  constexpr double kOthers = 0.1, kBitsPerByte = 10.0;
  const double piece_s = link::can_transfer_s(link::kCanFd_5_Mbit, piece_payload_bytes()) / (1.0 - kOthers);
  return static_cast<std::uint32_t>(kBitsPerByte * static_cast<double>(kPieceFrame_bytes) / piece_s);
}

struct Outcome {
  ClosedLoopResult result;
  std::vector<Handed> handed;
};

// Pressed into a block and dragged over two of its cells.
Outcome run(std::uint32_t baud, const TraceWish& trace) {
  const Body body = test::drag_body();
  const ClosedLoopConfig config = test::drag_config(kTicks, kHostDelay_ticks, trace);
  plant::Plant plant = test::drag_plant(-0.006);
  test::MemoryPeer board;
  Watched down(baud);
  link::Uart up(baud);
  Outcome outcome{run_closed_loop(body, body.rest_state(), plant, board, down, up, config, {}),
                  std::move(down.handed)};
  EXPECT_TRUE(board.has_shut_down());
  return outcome;
}

// While bases cross a line of CAN FD's speed, each state is handed over in the tick in which it is computed
// and waits for what the line had begun at most; and a basis is there within 100 ms.
TEST(ClosedLoop, BasesCrossInWhatStatesLeave) {
  const std::uint32_t baud = can_fd_baud();
  const Outcome outcome = run(baud, {TraceForm::tip, 4});
  const double bytes_per_tick = baud / 1e4;
  struct Crossing {
    std::uint32_t first_tick = 0;
    double until_tick = 0;
  };
  std::map<std::uint32_t, Crossing> bases;
  std::uint32_t crossing = 0;  // identifier of the basis whose pieces came last
  int states = 0, states_beside_pieces = 0;
  double longest_wait_ticks = 0;
  for (const Handed& one : outcome.handed) {
    const double arrives = one.tick + static_cast<double>(one.before_bytes + one.bytes) / bytes_per_tick;
    if (one.specifier == wire::kModelPartSubject) {
      EXPECT_LE(one.bytes, kPieceFrame_bytes);
      auto [basis, is_new] = bases.try_emplace(one.basis_id);
      if (is_new) basis->second.first_tick = one.tick;
      basis->second.until_tick = arrives;
      crossing = one.basis_id;
    } else if (one.specifier == wire::kModelStateSubject) {
      ++states;
      if (crossing != 0 && one.basis_id != crossing) ++states_beside_pieces;
      // Less than a tick of what came before, and a block.
      EXPECT_LE(static_cast<double>(one.before_bytes),
                bytes_per_tick + static_cast<double>(kPieceFrame_bytes))
          << one.tick;
      longest_wait_ticks =
          std::max(longest_wait_ticks, static_cast<double>(one.before_bytes) / bytes_per_tick);
    }
  }
  EXPECT_GE(bases.size(), 3u);
  EXPECT_GE(states, 20);
  EXPECT_GE(states_beside_pieces, 4);
  double longest_ticks = 0;
  for (const auto& [id, basis] : bases)
    longest_ticks = std::max(longest_ticks, basis.until_tick - basis.first_tick);
  EXPECT_LT(longest_ticks, 100.0);
  EXPECT_LT(longest_wait_ticks, 2.0);
  RecordProperty("bases", std::to_string(bases.size()));
  RecordProperty("basis_ticks", std::to_string(longest_ticks));
  RecordProperty("wait_ticks", std::to_string(longest_wait_ticks));

  // Each in its turn: the first one waits for its basis, no other one does.
  const Session clock(test::block(3), test::block(3).rest_state(), {});
  ASSERT_GE(outcome.result.updates.size(), 20u);
  for (std::size_t i = 1; i < outcome.result.updates.size(); ++i)
    EXPECT_TRUE(clock.due(outcome.result.updates[i].sent_tick - kHostDelay_ticks))
        << outcome.result.updates[i].sent_tick;
}

// The same updates of the same ticks whichever the form of the trace; fewer bytes up.
TEST(ClosedLoop, TipsAloneLeadToTheSameUpdates) {
  constexpr std::uint32_t kBaud = 12'000'000;
  const ClosedLoopResult full = run(kBaud, {TraceForm::full, 4}).result;
  const ClosedLoopResult tips = run(kBaud, {TraceForm::tip, 4}).result;
  ASSERT_EQ(full.updates.size(), tips.updates.size());
  for (std::size_t i = 0; i < full.updates.size(); ++i) {
    EXPECT_EQ(full.updates[i].tick, tips.updates[i].tick);
    EXPECT_EQ(full.updates[i].sent_tick, tips.updates[i].sent_tick);
    EXPECT_EQ(tips.updates[i].interpolated_ticks, 0u);
  }
  const auto bytes_up = [](const ClosedLoopResult& result) {
    std::size_t bytes = 0;
    for (const LoopTick& tick : result.ticks) bytes += tick.link_up_bytes;
    return bytes;
  };
  EXPECT_LT(2 * bytes_up(tips), bytes_up(full));
  EXPECT_EQ(tips.counters.frames_lost_up + tips.counters.frames_lost_down, 0u);
}

}  // namespace
}  // namespace palpate::host
