// What every receiver of frames tells: what came, and what was refused.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/status.hpp"
#include "shared/wire/frame.hpp"

namespace palpate::wire {

// What a receiver has seen since it was made.
struct ReceiverCounters {
  std::uint32_t frames = 0;  // delivered: on CAN whole transfers
  // By the fault's Status value, frame_too_long to too_many_transfers; entry 0 stays 0.
  std::array<std::uint32_t, static_cast<std::size_t>(Status::too_many_transfers) + 1> faults{};
  Status last_fault = Status::ok;
  std::uint32_t repeated_can_frames = 0;  // of transfers in several; left out, no fault

  void count(Status fault) {
    ++faults[static_cast<std::size_t>(fault)];
    last_fault = fault;
  }
  [[nodiscard]] std::uint32_t of(Status fault) const { return faults[static_cast<std::size_t>(fault)]; }
  [[nodiscard]] std::uint32_t refused() const {
    std::uint32_t sum = 0;
    for (const std::uint32_t count : faults) sum += count;
    return sum;
  }
};

struct Reception {
  std::size_t consumed = 0;  // bytes taken from the front of the input
  bool complete = false;     // `frame` holds a frame; valid until the next call of receive()
  Frame frame{};
};

}  // namespace palpate::wire
