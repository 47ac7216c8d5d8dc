// Ports of pins. Registers: RCC_AHB1ENR.GPIOxEN.
#pragma once

#include "boards/stm32/pins.hpp"
#include "boards/stm32f4/registers.hpp"

namespace palpate::stm32f4 {

inline void enable_ports() {
  switch_on(RCC[rcc::AHB1ENR], rcc::AHB1ENR_GPIOBEN | rcc::AHB1ENR_GPIOCEN);
}

}  // namespace palpate::stm32f4
