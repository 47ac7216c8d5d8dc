// The ports of firmware/ports/ports.hpp on the Adafruit Feather STM32F405: a skeleton (skeleton.txt), whose
// servo ticks, whose link speaks, and which cannot be armed.
#pragma once

#include <cstdint>

#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/idle.hpp"
#include "boards/skeleton/no_arm.hpp"
#include "boards/stm32/tick_guard.hpp"
#include "boards/stm32f4/clock.hpp"
#include "boards/stm32f4/timebase.hpp"
#include "boards/stm32f4/usart_link.hpp"
#include "firmware/ports/ports.hpp"

extern "C" {
// By this name a debugger finds it, and the machine of the tests. Written by the tick.
extern palpate::firmware::TickReport palpate_last_tick_report;
}

namespace palpate::board {

class FeatherStm32f405 : public NoArm {
 public:
  // Before the first tick, in this order: enable low, clocks, all else. The watchdog runs when begin()
  // returns.
  static stm32f4::ClockSource begin_pins_and_clock();
  void begin();
  void start_ticks() { timebase_.start_ticks(); }
  // Background, when there is nothing to do: waits for the next interrupt unless due().
  template <class Due>
  void idle(Due due) {
    cortex_m::idle_unless(due);
  }

  // TickPort
  void isr_begin_tick(std::uint32_t tick);
  void isr_end_tick(const firmware::TickReport& report);

  // AmplifierPort, but for what NoArm says; EmergencyStopPort
  void isr_disable_amplifiers();
  [[nodiscard]] bool isr_emergency_stop_open() const { return emergency_stop_open_; }

  // ClockPort
  [[nodiscard]] std::uint32_t clock_count() const { return stm32f4::Timebase::clock_count(); }
  [[nodiscard]] std::uint32_t clock_Hz() const { return stm32f4::kTimerClock_Hz; }
  [[nodiscard]] std::uint32_t first_due_count() const { return timebase_.first_due_count(); }

  // ResetPort, of which a board without motors keeps no tick
  [[nodiscard]] static firmware::ResetReport reset_report() { return cortex_m::reset_report(); }

  // LinkPort
  firmware::LinkBuffers& link() { return link_; }
  void poll_receive() { wire_.poll_receive(); }
  void start_transmit() {
    wire_.start_transmit();
    guard_.note_background();
  }

 private:
  firmware::LinkBuffers link_{};
  stm32f4::Timebase timebase_;
  stm32f4::UsartLink wire_{link_};

  stm32f4::TickGuard guard_;
  bool emergency_stop_open_ = true;
};

}  // namespace palpate::board
