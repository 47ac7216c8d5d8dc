#include "host/link/can_cost.hpp"

#include <gtest/gtest.h>

#include "shared/wire/messages.hpp"

namespace palpate::link {
namespace {

// Of a model with 48 modes and 32 nodes, without modal positions, as the host sends it.
std::size_t state_bytes() {
  palpate_ModelState_1_0 state{};
  state.displacement.count = 3 * 32;
  state.load.count = state.p.count = 48;
  return wire::payload_bytes(state);
}

template <class Message>
constexpr std::size_t kMost = wire::MessageTraits<Message>::kMaxBytes;

// Seconds on the bus in a second: states at 30 Hz and what the board answers to them, and its status.
double states_share(const CanBus& bus) {
  return 30.0 * (can_transfer_s(bus, state_bytes()) + can_transfer_s(bus, kMost<palpate_ModelReport_1_0>)) +
         10.0 * can_transfer_s(bus, kMost<palpate_BoardStatus_1_0>);
}

// The trace of every servo tick, four at a time.
double trace_share(const CanBus& bus) {
  palpate_ServoTrace_1_0 trace{};
  trace.samples.count = 4;
  return 250.0 * can_transfer_s(bus, wire::payload_bytes(trace));
}

// By hand: a classic frame of 8 bytes has 39 + 64 + 15 stuffable bits, with at most 29 stuff bits, and 13
// more.
TEST(CanCost, ClassicFramesAndTransfers) {
  const CanBus bus = kClassicCan_1_Mbit;
  EXPECT_NEAR(can_frame_s(bus, 8), 160e-6, 1e-12);
  EXPECT_NEAR(can_frame_s(bus, 1), 90e-6, 1e-12);
  EXPECT_EQ(can_frames(bus, 0), 1u);
  EXPECT_EQ(can_frames(bus, 7), 1u);
  EXPECT_EQ(can_frames(bus, 8), 2u);  // 8 and a CRC of 2
  EXPECT_EQ(can_frames(bus, 12), 2u);
  EXPECT_EQ(can_frames(bus, 13), 3u);
  EXPECT_NEAR(can_transfer_s(bus, 12), 320e-6, 1e-12);
}

// By hand: 36 + 8 stuff bits and 13 at 1 us; 5 + 512 with 129 stuff bits, 1, 4, 21 and 7 at 0.2 us.
TEST(CanCost, FramesOfCanFd) {
  const CanBus bus = kCanFd_5_Mbit;
  EXPECT_NEAR(can_frame_s(bus, 64), 57e-6 + 679 * 0.2e-6, 1e-12);
  EXPECT_EQ(can_frames(bus, 63), 1u);
  EXPECT_EQ(can_frames(bus, 64), 2u);
  EXPECT_EQ(can_frames(bus, 124), 2u);
  EXPECT_EQ(can_frames(bus, 125), 3u);
}

// States alone take a third of classic CAN. The trace of all samples, full, takes more than the rest: it
// needs a shorter form there (docs/protocol.md, "On a CAN bus").
TEST(CanCost, StatesFitClassicCanTheFullTraceBesideThemDoesNot) {
  EXPECT_LT(states_share(kClassicCan_1_Mbit), 0.40);
  EXPECT_LT(trace_share(kClassicCan_1_Mbit), 0.75);
  EXPECT_GT(states_share(kClassicCan_1_Mbit) + trace_share(kClassicCan_1_Mbit), 1.0);
}

// A basis of 48 modes, 32 nodes and 184 springs in pieces of 1,024 bytes, in what states and trace leave of
// the bus. They win the arbitration of every frame: what they wait for is one frame.
TEST(CanCost, ABasisCrossesCanFdBesideStatesAndTrace) {
  const CanBus bus = kCanFd_5_Mbit;
  const std::size_t bytes = wire::basis_layout(48, 32, 32, 1, 184, 3).bytes;
  EXPECT_GT(bytes, 11'000u);
  const double pieces = static_cast<double>((bytes + 1023) / 1024);
  const double basis_s = pieces * can_transfer_s(bus, kMost<palpate_ModelPart_1_0>);
  const double left = 1.0 - states_share(bus) - trace_share(bus);
  EXPECT_GT(left, 0.5);
  EXPECT_LT(basis_s / left, 0.1);
  EXPECT_LT(can_frame_s(bus, 64), 200e-6);
}

}  // namespace
}  // namespace palpate::link
