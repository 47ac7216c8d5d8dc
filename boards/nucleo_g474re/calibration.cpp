#include "boards/nucleo_g474re/calibration.hpp"

#include <array>
#include <cstring>
#include <span>

#include "boards/stm32g4/parameter_flash.hpp"

extern "C" {
[[gnu::used]] palpate::board::CalibrationRequest palpate_calibration_request;
}

namespace palpate::board {
namespace {

using stm32g4::CurrentCalibration;
using stm32g4::ParameterFlash;
using stm32g4::ParameterStore;
using stm32g4::StoreResult;

constexpr float kOffsetTolerance_raw = 0.1f * stm32g4::kRawSteps;
constexpr float kGainTolerance = 0.25f;

// NaN is not.
bool is_near(const std::array<float, 3>& values, const std::array<float, 3>& nominal, float absolute,
             float relative) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float most = absolute + relative * nominal[i];
    const float off = values[i] - nominal[i];
    if (!(off >= -most && off <= most)) return false;
  }
  return true;
}

using Bytes = std::array<std::uint8_t, sizeof(CurrentCalibration)>;

StoreResult store(const CurrentCalibration& calibration) {
  if (!ParameterFlash::is_supported()) return StoreResult::not_supported;
  Bytes bytes;
  std::memcpy(bytes.data(), &calibration, sizeof calibration);
  ParameterFlash flash;
  return ParameterStore(flash).write(bytes);
}

}  // namespace

bool is_plausible(const CurrentCalibration& one) {
  const CurrentCalibration& nominal = kNominalCalibration;
  return is_near(one.setpoint_offset_raw, nominal.setpoint_offset_raw, kOffsetTolerance_raw, 0.0f) &&
         is_near(one.monitor_offset_raw, nominal.monitor_offset_raw, kOffsetTolerance_raw, 0.0f) &&
         is_near(one.setpoint_gain_raw_A, nominal.setpoint_gain_raw_A, 0.0f, kGainTolerance) &&
         is_near(one.monitor_gain_A_raw, nominal.monitor_gain_A_raw, 0.0f, kGainTolerance);
}

CurrentCalibration stored_calibration() {
  CurrentCalibration calibration = kNominalCalibration;
  Bytes bytes;
  ParameterFlash flash;
  if (!ParameterFlash::is_supported() || ParameterStore(flash).read(bytes) != StoreResult::ok)
    return calibration;
  std::memcpy(&calibration, bytes.data(), sizeof calibration);
  return is_plausible(calibration) ? calibration : kNominalCalibration;
}

void serve_calibration_request(bool amplifiers_off) {
  CalibrationRequest& asked = palpate_calibration_request;
  if (asked.request.load(std::memory_order_acquire) != CalibrationRequest::kStore) return;
  asked.result = amplifiers_off && is_plausible(asked.wanted)
                     ? static_cast<std::uint32_t>(store(asked.wanted))
                     : CalibrationRequest::kRefused;
  asked.request.store(0, std::memory_order_release);
}

}  // namespace palpate::board
