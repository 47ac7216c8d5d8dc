// Three quadrature encoders on TIM2 (32 bits), TIM3 and TIM4 (16 bits, extended here), four counts a line.
//
// Registers: RCC_APB1ENR1; TIMx_CCMR1 (both inputs direct, filtered), CCMR2 (channel of the index, filtered),
// CCER (its capture, rising edge), ARR, SMCR.SMS = 3, CR1.CEN. In the tick CNT, SR and, where the index has
// passed, CCR3 or CCR4, whose reading clears the flag.
//
// An index pulse latches the count in hardware, on TIM2's and TIM3's channel 3 and TIM4's channel 4.
#pragma once

#include <array>
#include <cstdint>

#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

// Where an index was seen last. Written by the tick.
struct EncoderIndex {
  std::uint32_t passes = 0;  // ticks in which it was seen
  std::int32_t count = 0;    // of its rising edge, as isr_counts() counts
};

class Encoders {
 public:
  // The pins are the board's.
  static void start();

  // Interrupt context, once a tick: counts now; 16-bit counters must not have moved by half their range,
  // 32,768 counts, since the last call.
  void isr_latch(std::array<EncoderIndex, 3>& index);
  [[nodiscard]] const std::array<std::int32_t, 3>& isr_counts() const { return counts_; }

 private:
  std::array<std::int32_t, 3> counts_{};
};

}  // namespace palpate::stm32g4
