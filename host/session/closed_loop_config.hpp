// What a closed loop is told.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "host/link/fault_plan.hpp"
#include "host/link/framing.hpp"
#include "host/session/session.hpp"
#include "host/session/trace_choice.hpp"

namespace palpate::host {

struct GripChange {
  std::uint32_t tick = 0;
  double grip = 1.0;
};

struct ClosedLoopConfig {
  std::uint32_t ticks = 0;
  std::uint32_t host_delay_ticks = 0;  // from the tick in which a model is due to its hand-over to the link
  bool arms_by_itself = true;
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
  std::vector<std::uint32_t> overlong_ticks, emergency_stop_ticks;
  std::vector<link::Fault> faults_down, faults_up;  // on the link, to the board and to the host
};

}  // namespace palpate::host
