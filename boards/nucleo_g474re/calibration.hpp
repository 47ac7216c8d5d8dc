// The board's calibration of its set-points and monitors, in flash.
#pragma once

#include <atomic>
#include <cstdint>

#include "boards/stm32g4/currents.hpp"
#include "boards/stm32g4/parameter_store.hpp"

namespace palpate::board {

// An ideal amplifier: 3.3 V are 16 A of set-point, so that 1.65 V are 0 A and 8 A come at either end; of the
// monitor they are 24 A, since the supervisor must see 10.5 A. docs/hardware.md, "Amplifiers".
inline constexpr stm32g4::CurrentCalibration kNominalCalibration{
    .setpoint_offset_raw = {2048.0f, 2048.0f, 2048.0f},
    .setpoint_gain_raw_A = {256.0f, 256.0f, 256.0f},
    .monitor_offset_raw = {2048.0f, 2048.0f, 2048.0f},
    .monitor_gain_A_raw = {24.0f / 4096, 24.0f / 4096, 24.0f / 4096},
};

// Is each number near enough to the nominal one to be of an amplifier that is wired as it should be? Offsets
// by 10 % of the range, gains by a quarter.
bool is_plausible(const stm32g4::CurrentCalibration& calibration);

// That in flash, or the nominal one.
stm32g4::CurrentCalibration stored_calibration();

// A debugger writes `wanted`, then `request`, while the firmware runs with the amplifiers off; the answer
// comes in `result`, and `request` is 0 again. The next start takes it. (There is no message of the link for
// it.)
struct CalibrationRequest {
  static constexpr std::uint32_t kStore = 0x524F5453;  // "STOR"
  static constexpr std::uint32_t kRefused = 100;       // result: amplifiers on, or not plausible

  std::atomic<std::uint32_t> request{0};
  std::uint32_t result = 0;  // StoreResult, or kRefused
  stm32g4::CurrentCalibration wanted{};
};
// Background context, once a tick.
void serve_calibration_request(bool amplifiers_off);

}  // namespace palpate::board

extern "C" {
extern palpate::board::CalibrationRequest palpate_calibration_request;
}
