// Ports of pins. Registers: RCC_AHB2ENR.GPIOxEN.
#pragma once

#include "boards/stm32/pins.hpp"
#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

inline void enable_ports() {
  switch_on(RCC[rcc::AHB2ENR],
            rcc::AHB2ENR_GPIOAEN | rcc::AHB2ENR_GPIOBEN | rcc::AHB2ENR_GPIOCEN | rcc::AHB2ENR_GPIOFEN);
}

}  // namespace palpate::stm32g4
