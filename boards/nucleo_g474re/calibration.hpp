// What set-points and monitors are on this board with ideal amplifiers. How a board's own differ is in its
// registers (firmware/core/tuning.hpp).
#pragma once

#include "boards/stm32g4/currents.hpp"

namespace palpate::board {

// 3.3 V are 16 A of set-point, so that 1.65 V are 0 A and 8 A come at either end; of the monitor they are
// 24 A, since the supervisor must see 10.5 A. docs/hardware.md, "Amplifiers".
inline constexpr stm32g4::CurrentCalibration kNominalCalibration{
    .setpoint_offset_raw = {2048.0f, 2048.0f, 2048.0f},
    .setpoint_gain_raw_A = {256.0f, 256.0f, 256.0f},
    .monitor_offset_raw = {2048.0f, 2048.0f, 2048.0f},
    .monitor_gain_A_raw = {24.0f / 4096, 24.0f / 4096, 24.0f / 4096},
};

}  // namespace palpate::board
