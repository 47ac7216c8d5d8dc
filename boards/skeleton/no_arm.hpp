// Encoders and amplifiers of a board that has no drivers for them yet: what is not there says so, and nothing
// can be armed. A port begins with this as a base class, and writes a driver for each function of it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "firmware/ports/ports.hpp"

namespace palpate::board {

class NoArm : public firmware::KeepsNothing {
 public:
  // No currents are measured, and no number says so: the supervisor latches not_a_number from the first tick,
  // and refuses to arm and to clear it (docs/safety.md). So nobody acts on the counts either.
  [[nodiscard]] std::array<float, 3> isr_measured_currents_A() const {
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    return {kUnknown, kUnknown, kUnknown};
  }
  // Nobody watches the supply: that counts as low.
  [[nodiscard]] bool isr_supply_low() const { return true; }
  [[nodiscard]] std::array<std::int32_t, 3> isr_encoder_counts() const { return {}; }
  void isr_set_currents(const std::array<float, 3>&) {}
  // Not even with a key: there are no set-points that would be 0 A.
  void isr_enable_amplifiers(firmware::EnableKey) {}
};

}  // namespace palpate::board
