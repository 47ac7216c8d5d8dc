// Errors on a bus whose controllers send again what an error has hit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::link {

// In the ticks from first_tick on, before end_tick, each frame or packet that one direction sends is hit with
// that chance, each attempt anew.
struct BusError {
  std::size_t direction = 0;  // 0: down, 1: up
  double chance = 0.0;        // 0 to 1, less than 1
  std::uint32_t first_tick = 0;
  std::uint32_t end_tick = 0xffffffffu;
};
struct BusErrors {
  std::vector<BusError> errors;
  std::uint32_t seed = 1;
};

// Throws std::invalid_argument, which begins with `who`, for a direction or a chance out of its range.
void check_bus_errors(const BusErrors& errors, const char* who);

// The number-th of a series of numbers in [0, 1) that look random (SplitMix64 of Steele, Lea and Flood,
// 2014): a state that is copied goes on as the original does.
double drawn(std::uint64_t seed, std::uint64_t number);

}  // namespace palpate::link
