// TIM5 and TIM7 at 84 MHz (stm32/timebase.hpp). Registers: RCC_APB1ENR.
#pragma once

#include "boards/stm32/timebase.hpp"
#include "boards/stm32f4/clock.hpp"
#include "boards/stm32f4/registers.hpp"

namespace palpate::stm32f4 {

using Timebase = stm32::Apb1Timebase<kTimerClock_Hz, interrupt::TIM7>;

inline void enable_timebase() {
  switch_on(RCC[rcc::APB1ENR], rcc::APB1ENR_TIM5EN | rcc::APB1ENR_TIM7EN);
}

}  // namespace palpate::stm32f4
