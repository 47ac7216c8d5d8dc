#include "boards/nucleo_g474re/board.hpp"

#include "boards/stm32g4/fail_safe.hpp"
#include "boards/stm32g4/fault_record.hpp"
#include "boards/stm32g4/watchdog.hpp"

extern "C" {
[[gnu::used]] palpate::firmware::TickReport palpate_last_tick_report;
[[gnu::used]] std::array<palpate::stm32g4::EncoderIndex, 3> palpate_encoder_index;
}

namespace palpate::board {
namespace {

using stm32g4::CurrentSetpoints;
using stm32g4::PinMode;
using stm32g4::Pull;

// Ticks after which a start has succeeded.
constexpr std::uint32_t kStarted_ticks = 1000;

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
  stm32g4::Timebase::start_clock_count();
  for (const Pin pin : kAnalogPins) stm32g4::set_mode(pin, PinMode::analog);
  CurrentSetpoints::start();
  stm32g4::set_mode(kEmergencyStopPin, PinMode::input, Pull::up);
  for (const AlternatePin& one : kEncoderPins) stm32g4::set_alternate(one.pin, one.function, Pull::up);
  stm32g4::Encoders::start();
  stm32g4::CurrentMonitors::start();
  wire_.begin();
  stm32g4::require(stm32g4::start_watchdog(), stm32g4::IWDG[stm32g4::iwdg::SR]);
}

void NucleoG474re::isr_begin_tick(std::uint32_t tick) {
  encoders_.isr_latch(palpate_encoder_index);
  monitors_.isr_latch();
  emergency_stop_open_ = stm32g4::is_high(kEmergencyStopPin);
  tick_.store(tick, std::memory_order_relaxed);
}

// The watchdog is refreshed by a tick that has ended in time, while the background comes round.
void NucleoG474re::isr_end_tick(const firmware::TickReport& report) {
  palpate_last_tick_report = report;
  const bool in_time = report.missed_deadlines == missed_deadlines_;
  missed_deadlines_ = report.missed_deadlines;
  const std::uint32_t silent_ticks = report.tick - background_tick_.load(std::memory_order_relaxed);
  if (silent_ticks > kBackgroundPatience_ticks) {
    stm32g4::record_fault(stm32g4::FaultReason::background_stuck, report.tick);
  } else if (in_time) {
    stm32g4::refresh_watchdog();
  }
  if (report.tick == kStarted_ticks) stm32g4::note_started();
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

}  // namespace palpate::board
