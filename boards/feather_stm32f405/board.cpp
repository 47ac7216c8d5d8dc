#include "board.hpp"

#include "boards/cortex_m/fail_safe.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "pins.hpp"

extern "C" {
[[gnu::used]] palpate::firmware::TickReport palpate_last_tick_report;
}

namespace palpate::board {

using stm32f4::PinMode;
using stm32f4::Pull;

void fail_safe() {
  stm32f4::set_low(kEnablePin);
}

stm32f4::ClockSource FeatherStm32f405::begin_pins_and_clock() {
  stm32f4::enable_ports();
  stm32f4::set_low(kEnablePin);
  stm32f4::set_mode(kEnablePin, PinMode::output);
  return stm32f4::start_clock();
}

void FeatherStm32f405::begin() {
  stm32f4::enable_timebase();
  stm32f4::Timebase::start_clock_count();
  stm32f4::set_mode(kEmergencyStopPin, PinMode::input, Pull::up);
  stm32f4::set_alternate(kTransmitPin);
  stm32f4::set_alternate(kReceivePin, Pull::up);
  wire_.begin();
  stm32f4::require(stm32f4::start_watchdog(), stm32f4::IWDG[stm32f4::iwdg::SR]);
}

void FeatherStm32f405::isr_begin_tick(std::uint32_t tick) {
  emergency_stop_open_ = stm32f4::is_high(kEmergencyStopPin);
  guard_.isr_begin_tick(tick);
}

void FeatherStm32f405::isr_end_tick(const firmware::TickReport& report) {
  palpate_last_tick_report = report;
  guard_.isr_end_tick(report);
}

void FeatherStm32f405::isr_disable_amplifiers() {
  fail_safe();
}

}  // namespace palpate::board
