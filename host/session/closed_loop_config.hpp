// What a closed loop is told.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "host/link/delay_line.hpp"
#include "host/link/fault_plan.hpp"
#include "host/link/framing.hpp"
#include "host/session/session.hpp"
#include "host/session/trace_choice.hpp"

namespace palpate::host {

struct GripChange {
  std::uint32_t tick = 0;
  double grip = 1.0;
};

// From first_tick on, before end_tick.
struct TickSpan {
  std::uint32_t first_tick = 0;
  std::uint32_t end_tick = 0;
};

inline bool contains(const std::vector<TickSpan>& spans, std::uint32_t tick) {
  return std::any_of(spans.begin(), spans.end(), [tick](const TickSpan& span) {
    return tick >= span.first_tick && tick < span.end_tick;
  });
}

// What goes wrong on the link and at its other end, in spans of time; equal seeds draw equally.
struct LinkTroubles {
  std::uint32_t seed = 1;
  std::vector<link::RandomFault> random_down, random_up;
  std::vector<link::Delay> delay_down, delay_up;
  std::vector<TickSpan> unplugged;  // nothing passes; what was submitted before arrives
  std::vector<TickSpan>
      host_stopped;  // the host's process hears and says nothing, and goes on with what waits
  std::vector<TickSpan> other_schema;  // the host's models carry another schema hash than the board's
  std::vector<TickSpan> second_host;   // of another node: commands, models and requests of its own
  std::vector<TickSpan> babble;        // on CAN: a node fills the bus with frames of the first priority
  std::vector<TickSpan> refused;       // on USB: the device refuses all packets, and has none
  // It sends frame after frame, so much of what the link carries.
  struct Flood {
    TickSpan span{};
    double load = 1.0;
  };
  std::vector<Flood> flood;
};

// From that tick on the encoder of a joint reads so many counts more: a broken disc, or a loose cable.
struct EncoderSlip {
  std::uint32_t tick = 0;
  std::size_t joint = 0;  // 0 to 2
  std::int32_t count = 0;
};

struct ClosedLoopConfig {
  std::uint32_t ticks = 0;
  std::uint32_t host_delay_ticks = 0;  // from the tick in which a model is due to its hand-over to the link
  bool arms_by_itself = true;
  // Names that a board may give itself (palpate.GetInfo) to be armed; empty: it is the loop's own.
  std::vector<std::string> known_boards;
  std::uint64_t first_transfer_id = 0;  // link::EndpointOptions
  std::uint32_t models_under_way = 1;   // that the host may compute at a time
  // Models are computed in a thread of their own, and are there when they are there, at the end of the host's
  // delay at the earliest: for loops in real time, never for results to be repeated.
  bool session_beside = false;
  TraceWish trace{};  // what the board is asked to send of its ticks
  link::FramingKind framing =
      link::FramingKind::serial;  // the board's; faults on the link are serial frames'
  firmware::CatchUpPolicy catch_up_policy = firmware::kCatchUpCortexM4;  // the board's
  SessionConfig session{};
  std::vector<GripChange> grip_changes;  // increasing ticks
  std::optional<int> probe_node;         // whose rendered positions are wanted
  // Test inputs.
  std::vector<std::uint32_t> overlong_ticks, emergency_stop_ticks, reset_ticks, supply_low_ticks;
  std::vector<EncoderSlip> encoder_slips;
  std::vector<link::Fault> faults_down, faults_up;  // on the link, to the board and to the host
  LinkTroubles troubles{};
};

}  // namespace palpate::host
