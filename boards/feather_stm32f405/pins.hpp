// What is wired to which pin of the Adafruit Feather STM32F405 Express. docs/hardware.md has the same table.
#pragma once

#include "boards/stm32f4/pins.hpp"

namespace palpate::board {

using stm32::AlternatePin;
using stm32::Pin;

// Marked D6. High: amplifiers on, which no image for this board does yet. A resistor of 10 kOhm to ground on
// the amplifiers' side keeps it low while the part is in reset.
inline constexpr Pin kEnablePin{stm32f4::GPIOC, 6};
// Marked D5. To ground through the closed emergency-stop chain, pulled up here: open, or a broken wire, reads
// high.
inline constexpr Pin kEmergencyStopPin{stm32f4::GPIOC, 7};
// Marked TX and RX: USART3, function 7 (DS8626, table 9).
inline constexpr AlternatePin kTransmitPin{{stm32f4::GPIOB, 10}, 7};
inline constexpr AlternatePin kReceivePin{{stm32f4::GPIOB, 11}, 7};

}  // namespace palpate::board
