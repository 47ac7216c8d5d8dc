#include "host/link/bus_errors.hpp"

#include <stdexcept>
#include <string>

namespace palpate::link {

void check_bus_errors(const BusErrors& errors, const char* who) {
  constexpr std::size_t kDirections = 2;
  for (const BusError& error : errors.errors)
    if (!(error.chance >= 0.0 && error.chance < 1.0) || error.direction >= kDirections)
      throw std::invalid_argument(
          std::string(who) + ": errors of direction " + std::to_string(error.direction) + " with chance " +
          std::to_string(error.chance) + "; directions are 0 and 1, chances 0 to less than 1");
}

double drawn(std::uint64_t seed, std::uint64_t number) {
  std::uint64_t z = (seed << 32) + (number + 1) * 0x9E3779B97F4A7C15u;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  constexpr double kRange = 18446744073709551616.0;
  return static_cast<double>(z ^ (z >> 31)) / kRange;
}

}  // namespace palpate::link
