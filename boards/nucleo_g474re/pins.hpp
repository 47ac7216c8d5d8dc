// What is wired to which pin of the NUCLEO-G474RE (MB1367). docs/hardware.md has the same table for who
// solders.
#pragma once

#include <array>

#include "boards/stm32g4/pins.hpp"

namespace palpate::board {

using stm32::AlternatePin;
using stm32g4::GPIOA;
using stm32g4::GPIOB;
using stm32g4::GPIOC;
using stm32g4::Pin;

// Encoders: A, B and index. Functions of pins: DS12288.
inline constexpr std::array<AlternatePin, 9> kEncoderPins{{
    {{GPIOA, 0}, 1},   // TIM2_CH1
    {{GPIOA, 1}, 1},   // TIM2_CH2
    {{GPIOB, 10}, 1},  // TIM2_CH3
    {{GPIOC, 6}, 2},   // TIM3_CH1
    {{GPIOC, 7}, 2},   // TIM3_CH2
    {{GPIOC, 8}, 2},   // TIM3_CH3
    {{GPIOB, 6}, 2},   // TIM4_CH1
    {{GPIOB, 7}, 2},   // TIM4_CH2
    {{GPIOB, 9}, 2},   // TIM4_CH4; channel 3 is on PB8, which is BOOT0
}};

// DAC1_OUT1, DAC1_OUT2 (also the board's LED), DAC2_OUT1; ADC12_IN6 to IN8. Analog is what reset leaves.
inline constexpr std::array<Pin, 6> kAnalogPins{
    {{GPIOA, 4}, {GPIOA, 5}, {GPIOA, 6}, {GPIOC, 0}, {GPIOC, 1}, {GPIOC, 2}}};

// High: amplifiers on. A resistor of 10 kOhm to ground on the amplifiers' side keeps it low while the part is
// in reset.
inline constexpr Pin kEnablePin{GPIOB, 1};
// To ground through the closed emergency-stop chain, pulled up here: open, or a broken wire, reads high.
inline constexpr Pin kEmergencyStopPin{GPIOB, 14};

inline constexpr AlternatePin kLpuartTransmitPin{{GPIOA, 2}, 12};  // to the ST-LINK
inline constexpr AlternatePin kLpuartReceivePin{{GPIOA, 3}, 12};
inline constexpr AlternatePin kFdcanReceivePin{{GPIOB, 12}, 9};
inline constexpr AlternatePin kFdcanTransmitPin{{GPIOB, 13}, 9};

}  // namespace palpate::board
