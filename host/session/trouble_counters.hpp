// What the faults of a loop's link have done (LinkTroubles).
#pragma once

#include <cstdint>

#include "host/link/fault_plan.hpp"

namespace palpate::host {

// Of one direction, by frames; on CAN by frames of the bus.
struct DirectionTroubles {
  std::uint64_t frames = 0;  // that came, before any fault
  link::FaultCounts hit{};
  std::uint64_t delayed = 0;  // submissions
  std::uint64_t cut = 0;      // by a cable that is out
};

struct TroubleCounters {
  DirectionTroubles down{}, up{};
  // Frames, on CAN transfers, that did not get through: those spoilt, and those that a cable that is out has
  // kept.
  std::uint64_t frames_removed_down = 0, frames_removed_up = 0;
  std::uint64_t foreign_frames = 0;  // of a second host, a flood, a babbling node
};

}  // namespace palpate::host
