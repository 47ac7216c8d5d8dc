// Range checks at the edge of the plant.
#pragma once

#include <sstream>
#include <stdexcept>

namespace palpate::plant {

// Throws std::invalid_argument with name, value and range unless low <= value <= high (so NaN throws).
inline void require_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream message;
  message << name << " is " << value << ", allowed " << low << " to " << high;
  throw std::invalid_argument(message.str());
}

}  // namespace palpate::plant
