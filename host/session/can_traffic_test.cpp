// What a session with the compact trace takes of a CAN bus, with the sizes of real models' messages: there is
// no bus here yet (host/link/can_cost.hpp).

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "host/link/can_cost.hpp"
#include "host/session/session.hpp"
#include "host/session/test_contact.hpp"
#include "host/session/trace_choice.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::host {
namespace {

using link::CanBus;
using test::block;
using test::Path;

constexpr double kUpdate_Hz = 30.0, kStatus_Hz = 10.0;

template <class Message>
constexpr std::size_t kMost = wire::MessageTraits<Message>::kMaxBytes;

std::size_t trace_bytes(TraceForm form, std::size_t ticks) {
  if (form == TraceForm::full) {
    palpate_ServoTrace_1_0 trace{};
    trace.samples.count = ticks;
    return wire::payload_bytes(trace);
  }
  palpate_TipTrace_1_0 trace{};
  trace.offsets.count = ticks - 1;
  return wire::payload_bytes(trace);
}

// Largest messages of the models while the tip is pressed into a body and dragged over it.
struct Sizes {
  std::size_t state_bytes = 0, basis_bytes = 0;
  int modes = 0, nodes = 0, springs = 0;
};

Sizes sizes_of(Builder builder) {
  const Body body = block(9);
  SessionConfig config;
  config.friction.elsewhere = {0.5, 0.5};
  config.model.builder = builder;
  // Scenes' defaults.
  config.model.tangent = builder == Builder::krylov ? TangentAt::rest : TangentAt::frame;
  config.model.shift_rad_s = {0.0};
  if (builder == Builder::hybrid) config.model.middle_shift_rad_s = {2.0 * std::numbers::pi * 20.0};
  Session session(body, body.rest_state(), config);
  Path path({0.0345, 0.0365, 5e-4});
  path.to({0.0345, 0.0365, -3e-3}, 60).to({0.0445, 0.0375, -3e-3}, 139);
  Sizes most;
  for (std::uint32_t tick = 0; tick <= path.ticks(); ++tick) {
    palpate_ServoTrace_1_0 trace{};
    trace.first_tick = tick;
    trace.samples.count = 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
      trace.samples.elements[0].tip_m[axis] = static_cast<float>(path.tip_m[tick][axis]);
    session.take(trace);
    if (!session.due(tick)) continue;
    const auto update = session.update();
    if (!update) continue;
    most.state_bytes = std::max(most.state_bytes, wire::payload_bytes(update->packed.state));
    most.basis_bytes = std::max(most.basis_bytes, update->packed.basis->size());
    most.modes = std::max(most.modes, static_cast<int>(update->message.modes));
    most.nodes = std::max(most.nodes, static_cast<int>(update->message.nodes));
    most.springs = std::max(most.springs, static_cast<int>(update->message.spring_kind.count));
  }
  return most;
}

// Of the bus, both directions: states at 30 Hz and what the board answers to each, its status, and its trace.
struct Share {
  double states = 0, trace = 0;
  [[nodiscard]] double all() const { return states + trace; }
};

Share share(const CanBus& bus, std::size_t state_bytes, TraceForm form, std::size_t ticks) {
  return {kUpdate_Hz * (link::can_transfer_s(bus, state_bytes) +
                        link::can_transfer_s(bus, kMost<palpate_ModelReport_1_0>)) +
              kStatus_Hz * link::can_transfer_s(bus, kMost<palpate_BoardStatus_1_0>),
          link::can_transfer_s(bus, trace_bytes(form, ticks)) / (static_cast<double>(ticks) * 1e-3)};
}

// Most that the board takes of a model with a near field, without modal positions, as the host sends it.
std::size_t most_hybrid_bytes() {
  palpate_ModelState_1_0 state{};
  state.displacement.count = 3 * kMaxSurfaceNodes;
  state.load.count = state.p.count = kMaxNearModes;
  return wire::payload_bytes(state);
}

// One kind of transfers on a bus. Whoever has the least identifier sends the next frame: priority, then
// subject (Cyphal/CAN), which is the order of these in a list.
struct Stream {
  double first_s = 0, period_s = 0;  // of the instants at which one is handed to the bus
  std::size_t bytes = 0;
  double longest_s = 0;  // from there to the end of its last frame
};

struct Bus {
  CanBus bus;
  std::vector<Stream> streams;  // the most urgent first
  // Pieces of a basis, each handed over when the one before has crossed; they give way to all streams.
  std::vector<std::size_t> pieces{};
  double pieces_from_s = 0;
  double pieces_until_s = std::numeric_limits<double>::infinity();  // when the last has crossed

  // All frames of so many seconds, in the order in which they win the bus.
  void run(double duration_s) {
    struct Queue {
      double handed_s = 0;        // of the transfer at hand
      std::size_t sent = 0;       // of its frames
      std::size_t transfers = 0;  // before it
    };
    std::vector<Queue> queues(streams.size());
    for (std::size_t i = 0; i < streams.size(); ++i) queues[i].handed_s = streams[i].first_s;
    std::size_t piece = 0, piece_sent = 0;
    for (double now_s = 0; now_s < duration_s;) {
      bool sent = false;
      double next_s = piece < pieces.size() ? pieces_from_s : duration_s;
      for (std::size_t i = 0; i < streams.size() && !sent; ++i) {
        Queue& queue = queues[i];
        if (queue.handed_s > now_s) {
          next_s = std::min(next_s, queue.handed_s);
          continue;
        }
        now_s += frame_s(streams[i].bytes, queue.sent++);
        sent = true;
        if (queue.sent < link::can_frames(bus, streams[i].bytes)) continue;
        streams[i].longest_s = std::max(streams[i].longest_s, now_s - queue.handed_s);
        queue = {streams[i].first_s + static_cast<double>(queue.transfers + 1) * streams[i].period_s, 0,
                 queue.transfers + 1};
      }
      if (sent) continue;
      if (piece < pieces.size() && pieces_from_s <= now_s) {
        now_s += frame_s(pieces[piece], piece_sent++);
        if (piece_sent < link::can_frames(bus, pieces[piece])) continue;
        piece_sent = 0;
        if (++piece == pieces.size()) pieces_until_s = now_s;
      } else {
        now_s = std::max(now_s, next_s);
      }
    }
  }

 private:
  // The last frame of a transfer is what the whole is longer than the others.
  [[nodiscard]] double frame_s(std::size_t bytes, std::size_t index) const {
    const std::size_t frames = link::can_frames(bus, bytes);
    const double whole_s = link::can_frame_s(bus, bus.fd ? 64 : 8);
    return index + 1 < frames ? whole_s
                              : link::can_transfer_s(bus, bytes) - static_cast<double>(frames - 1) * whole_s;
  }
};

enum StreamOf : std::size_t { status_stream, report_stream, trace_stream, state_stream };
Bus traffic(const CanBus& bus, std::size_t state_bytes, std::size_t trace_ticks, std::mt19937& random) {
  const auto stream = [&](double period_s, std::size_t bytes) {
    return Stream{std::uniform_real_distribution<double>(0.0, period_s)(random), period_s, bytes};
  };
  return {bus,
          {stream(1.0 / kStatus_Hz, kMost<palpate_BoardStatus_1_0>),
           stream(1.0 / kUpdate_Hz, kMost<palpate_ModelReport_1_0>),
           stream(1e-3 * static_cast<double>(trace_ticks), trace_bytes(TraceForm::tip, trace_ticks)),
           stream(1.0 / kUpdate_Hz, state_bytes)}};
}

// The order above is that of the identifiers.
static_assert(wire::kBoardStatusSubject < wire::kModelReportSubject &&
              wire::kModelReportSubject < wire::kTipTraceSubject &&
              wire::kTipTraceSubject < wire::kModelStateSubject);

void record(const std::string& name, double value) {
  ::testing::Test::RecordProperty(name, std::to_string(value));
}

TEST(CanTraffic, StatesAndTipsFitClassicCanWithAnyBuilder) {
  const CanBus bus = link::kClassicCan_1_Mbit;
  for (const auto& [builder, name, modes] :
       {std::tuple{Builder::hybrid, "hybrid", 72}, std::tuple{Builder::krylov, "krylov", 48},
        std::tuple{Builder::patch, "patch", 96}}) {
    const Sizes sizes = sizes_of(builder);
    EXPECT_EQ(sizes.modes, modes) << name;
    const Share at_4 = share(bus, sizes.state_bytes, TraceForm::tip, 4);
    const Share at_8 = share(bus, sizes.state_bytes, TraceForm::tip, 8);
    const Share full = share(bus, sizes.state_bytes, TraceForm::full, 4);
    EXPECT_LT(at_4.all(), 0.70) << name;
    EXPECT_LT(at_8.all(), 0.65) << name;
    EXPECT_GT(full.all(), 1.0) << name;
    record(std::string(name) + "_state_bytes", static_cast<double>(sizes.state_bytes));
    record(std::string(name) + "_basis_bytes", static_cast<double>(sizes.basis_bytes));
    record(std::string(name) + "_nodes", sizes.nodes);
    record(std::string(name) + "_springs", sizes.springs);
    record(std::string(name) + "_states", at_4.states);
    record(std::string(name) + "_trace_4", at_4.trace);
    record(std::string(name) + "_trace_8", at_8.trace);
    record(std::string(name) + "_trace_full", full.trace);
  }
}

TEST(CanTraffic, TheLargestStatesWithANearFieldFitToo) {
  const Share at_4 = share(link::kClassicCan_1_Mbit, most_hybrid_bytes(), TraceForm::tip, 4);
  EXPECT_LT(at_4.all(), 0.85);
  record("states", at_4.states);
  record("trace_4", at_4.trace);
}

// Nothing queues up on classic CAN: every trace has crossed before the next, every state within half a frame.
TEST(CanTraffic, OnClassicCanNothingQueuesUp) {
  const std::size_t state_bytes = sizes_of(Builder::hybrid).state_bytes;
  std::mt19937 random(1);
  for (const std::size_t ticks : {4u, 8u}) {
    double state_s = 0, trace_s = 0;
    for (int trial = 0; trial < 50; ++trial) {
      Bus bus = traffic(link::kClassicCan_1_Mbit, state_bytes, ticks, random);
      bus.run(2.0);
      state_s = std::max(state_s, bus.streams[state_stream].longest_s);
      trace_s = std::max(trace_s, bus.streams[trace_stream].longest_s);
    }
    EXPECT_LT(trace_s, 1e-3 * static_cast<double>(ticks));
    EXPECT_LT(state_s, 0.75 / kUpdate_Hz);
    record("state_ms_beside_" + std::to_string(ticks), 1e3 * state_s);
    record("trace_ms_of_" + std::to_string(ticks), 1e3 * trace_s);
  }
}

// A basis of the default crosses CAN FD in what states and traces leave. Each of its frames that is on its
// way when a state comes delays that by itself; nothing else of it does. What comes for a higher stream in
// that time goes first, as it would have anyway a little later: a trace, a report and a status at most.
TEST(CanTraffic, ABasisCrossesCanFdWithoutDelayingStates) {
  const CanBus can = link::kCanFd_5_Mbit;
  const Sizes sizes = sizes_of(Builder::hybrid);
  const double frame_s = link::can_frame_s(can, 64);
  EXPECT_LT(frame_s, 0.2e-3);
  std::vector<std::size_t> pieces;
  constexpr std::size_t kBlock = palpate_ModelPart_1_0_BLOCK_BYTES;
  for (std::size_t at = 0; at < sizes.basis_bytes; at += kBlock) {
    palpate_ModelPart_1_0 part{};
    part.data.count = std::min(kBlock, sizes.basis_bytes - at);
    pieces.push_back(wire::payload_bytes(part));
  }
  std::mt19937 random(1);
  double longest_s = 0, delay_s = 0;
  for (int trial = 0; trial < 500; ++trial) {
    Bus alone = traffic(can, sizes.state_bytes, 4, random);
    Bus both = alone;
    both.pieces = pieces;
    both.pieces_from_s = std::uniform_real_distribution<double>(0.0, 0.1)(random);
    alone.run(0.4);
    both.run(0.4);
    longest_s = std::max(longest_s, both.pieces_until_s - both.pieces_from_s);
    delay_s = std::max(delay_s, both.streams[state_stream].longest_s - alone.streams[state_stream].longest_s);
    const double trace_s = link::can_transfer_s(can, trace_bytes(TraceForm::tip, 4));
    const double others_s = link::can_transfer_s(can, kMost<palpate_ModelReport_1_0>) +
                            link::can_transfer_s(can, kMost<palpate_BoardStatus_1_0>);
    ASSERT_LT(both.streams[state_stream].longest_s - alone.streams[state_stream].longest_s,
              frame_s + trace_s + others_s);
    ASSERT_LT(both.pieces_until_s - both.pieces_from_s, 0.1);
  }
  const Share taken = share(can, sizes.state_bytes, TraceForm::tip, 4);
  record("states", taken.states);
  record("trace_4", taken.trace);
  record("basis_ms", 1e3 * longest_s);
  record("delay_us", 1e6 * delay_s);
  record("state_ms", 1e3 * link::can_transfer_s(can, sizes.state_bytes));
}

}  // namespace
}  // namespace palpate::host
