// The one door to the amplifiers.
#pragma once

#include <array>

#include "firmware/ports/ports.hpp"

namespace palpate::firmware {

// Interrupt context. Only this class can make an EnableKey, so only isr_apply() can switch a board's
// amplifiers on, and only while the supervisor's decision of this same tick says so.
template <class Board>
class Outputs {
 public:
  explicit Outputs(Board& board) : board_(board) {}

  // Set-points first, then the enable: the amplifiers never see an enable with an older set-point. Off:
  // zeros, then disable, in this tick.
  void isr_apply(bool outputs_on, const std::array<float, 3>& setpoint_A) {
    if (outputs_on) {
      board_.isr_set_currents(setpoint_A);
      board_.isr_enable_amplifiers(EnableKey{});
    } else {
      board_.isr_set_currents({});
      board_.isr_disable_amplifiers();
    }
  }

 private:
  Board& board_;
};

}  // namespace palpate::firmware
