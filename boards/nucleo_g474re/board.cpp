#include "boards/nucleo_g474re/board.hpp"

#include "boards/cortex_m/fail_safe.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32/watchdog.hpp"
#include "boards/stm32g4/parameter_flash.hpp"
#include "boards/stm32g4/parameter_store.hpp"

extern "C" {
[[gnu::used]] palpate::firmware::TickReport palpate_last_tick_report;
[[gnu::used]] std::array<palpate::stm32g4::EncoderIndex, 3> palpate_encoder_index;
}

namespace palpate::board {
namespace {

using stm32g4::CurrentSetpoints;
using stm32g4::PinMode;
using stm32g4::Pull;

}  // namespace

void fail_safe() {
  stm32g4::set_low(kEnablePin);
  CurrentSetpoints::set_mid_scale();
}

stm32g4::ClockSource NucleoG474re::begin_pins_and_clock() {
  stm32g4::enable_ports();
  stm32g4::set_low(kEnablePin);
  stm32g4::set_mode(kEnablePin, PinMode::output);
  return stm32g4::start_clock();
}

void NucleoG474re::begin() {
  stm32g4::enable_timebase();
  stm32g4::Timebase::start_clock_count();
  for (const Pin pin : kAnalogPins) stm32g4::set_mode(pin, PinMode::analog);
  CurrentSetpoints::start();
  stm32g4::set_mode(kEmergencyStopPin, PinMode::input, Pull::up);
  for (const AlternatePin& one : kEncoderPins) stm32g4::set_alternate(one, Pull::up);
  stm32g4::Encoders::start();
  stm32g4::CurrentMonitors::start();
  stm32g4::SupplyMonitor::start();
  wire_.begin();
  stm32g4::require(stm32g4::start_watchdog(), stm32g4::IWDG[stm32g4::iwdg::SR]);
}

void NucleoG474re::isr_begin_tick(std::uint32_t tick) {
  encoders_.isr_latch(palpate_encoder_index);
  monitors_.isr_latch();
  supply_.isr_latch();
  emergency_stop_open_ = stm32g4::is_high(kEmergencyStopPin);
  guard_.isr_begin_tick(tick);
}

void NucleoG474re::isr_end_tick(const firmware::TickReport& report) {
  palpate_last_tick_report = report;
  guard_.isr_end_tick(report);
}

void NucleoG474re::isr_set_currents(const std::array<float, 3>& setpoint_A) {
  setpoint_A_ = setpoint_A;
  if (enabled_.load(std::memory_order_relaxed)) setpoints_.isr_set(setpoint_A_);
}

// The set-points are at mid-scale while the amplifiers are off, so that the enable rises on 0 A.
void NucleoG474re::isr_enable_amplifiers(firmware::EnableKey) {
  if (enabled_.load(std::memory_order_relaxed)) return;
  enabled_.store(true, std::memory_order_relaxed);
  stm32g4::set_high(kEnablePin);
  setpoints_.isr_set(setpoint_A_);
}

void NucleoG474re::isr_disable_amplifiers() {
  fail_safe();
  enabled_.store(false, std::memory_order_relaxed);
}

bool NucleoG474re::keeps_parameters() {
  return stm32g4::ParameterFlash::is_supported();
}

bool NucleoG474re::read_parameters(std::span<std::uint8_t> out) {
  stm32g4::ParameterFlash flash;
  return keeps_parameters() && stm32g4::ParameterStore(flash).read(out) == stm32g4::StoreResult::ok;
}

// Ticks go on meanwhile. With the amplifiers on nothing is written, whoever asks.
bool NucleoG474re::write_parameters(std::span<const std::uint8_t> in) {
  if (enabled_.load(std::memory_order_relaxed)) return false;
  if (!keeps_parameters()) return true;  // it holds until the next start, and the registers say so
  stm32g4::ParameterFlash flash;
  return stm32g4::ParameterStore(flash).write(in) == stm32g4::StoreResult::ok;
}

}  // namespace palpate::board
