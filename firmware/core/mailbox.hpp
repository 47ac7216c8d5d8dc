// What crosses between the servo interrupt and the background, apart from models and trace (renderer.hpp,
// servo.hpp).
#pragma once

#include <cstdint>

#include "firmware/core/supervisor.hpp"
#include "firmware/ports/spsc_ring.hpp"

namespace palpate::firmware {

// Who asked: travels with a command and comes back with its reply.
struct Requester {
  std::uint16_t node = 0;
  std::uint64_t transfer_id = 0;
};

struct CommandRequest {
  Command command{};
  Requester requester{};
};

struct CommandReply {
  CommandOutcome outcome{};
  Mode mode = Mode::boot;  // after the command
  Requester requester{};
};

// The interrupt's part of palpate.BoardStatus, all of one tick.
struct StatusSnapshot {
  std::uint32_t tick = 0;
  Mode mode = Mode::boot;
  FaultSet faults = 0;
  std::uint32_t token = 0;
  std::uint32_t missed_deadlines = 0;
  std::uint32_t worst_tick_count = 0;
};

struct Mailbox {
  SpscRing<CommandRequest, 4> commands;  // background to interrupt, which runs one a tick
  SpscRing<CommandReply, 8> replies;     // interrupt to background
  SpscRing<StatusSnapshot, 8> status;    // interrupt to background
};

}  // namespace palpate::firmware
