// TIM5 and TIM7 at 170 MHz (stm32/timebase.hpp). Registers: RCC_APB1ENR1.
#pragma once

#include "boards/stm32/timebase.hpp"
#include "boards/stm32g4/clock.hpp"
#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

using Timebase = stm32::Apb1Timebase<kSystemClock_Hz, interrupt::TIM7>;

inline void enable_timebase() {
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_TIM5EN | rcc::APB1ENR1_TIM7EN);
}

}  // namespace palpate::stm32g4
