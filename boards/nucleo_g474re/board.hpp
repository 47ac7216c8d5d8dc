// The ports of firmware/ports/ports.hpp on the NUCLEO-G474RE.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>

#include "board_wire.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/idle.hpp"
#include "boards/nucleo_g474re/calibration.hpp"
#include "boards/nucleo_g474re/pins.hpp"
#include "boards/stm32/tick_guard.hpp"
#include "boards/stm32g4/clock.hpp"
#include "boards/stm32g4/currents.hpp"
#include "boards/stm32g4/encoders.hpp"
#include "boards/stm32g4/supply.hpp"
#include "boards/stm32g4/timebase.hpp"
#include "firmware/ports/ports.hpp"

extern "C" {
// By these names a debugger finds them, and the machine of the tests. Written by the tick.
extern palpate::firmware::TickReport palpate_last_tick_report;
extern std::array<palpate::stm32g4::EncoderIndex, 3> palpate_encoder_index;
}

namespace palpate::board {

class NucleoG474re {
 public:
  explicit NucleoG474re(const std::array<std::uint8_t, 16>& unique_id)
      : setpoints_(kNominalCalibration), monitors_(kNominalCalibration), wire_(link_, unique_id) {}

  // Before the first tick, in this order: enable low, clocks, set-points at mid-scale, all else. The watchdog
  // runs when it returns.
  static stm32g4::ClockSource begin_pins_and_clock();
  void begin();
  void start_ticks() { timebase_.start_ticks(); }
  // Background, when there is nothing to do: waits for the next interrupt unless due().
  template <class Due>
  void idle(Due due);
  BoardWire& wire() { return wire_; }

  // TickPort
  void isr_begin_tick(std::uint32_t tick);
  void isr_end_tick(const firmware::TickReport& report);

  // EncoderPort, AmplifierPort, EmergencyStopPort, SupplyPort
  [[nodiscard]] std::array<std::int32_t, 3> isr_encoder_counts() const { return encoders_.isr_counts(); }
  [[nodiscard]] std::array<float, 3> isr_measured_currents_A() const { return monitors_.isr_currents_A(); }
  [[nodiscard]] bool isr_emergency_stop_open() const { return emergency_stop_open_; }
  [[nodiscard]] bool isr_supply_low() const { return supply_.isr_is_low(); }
  void isr_set_currents(const std::array<float, 3>& setpoint_A);
  void isr_enable_amplifiers(firmware::EnableKey key);
  void isr_disable_amplifiers();

  // ClockPort
  [[nodiscard]] std::uint32_t clock_count() const { return stm32g4::Timebase::clock_count(); }
  [[nodiscard]] std::uint32_t clock_Hz() const { return stm32g4::kSystemClock_Hz; }
  [[nodiscard]] std::uint32_t first_due_count() const { return timebase_.first_due_count(); }

  // ParameterPort: in flash, where the part is set up for it.
  [[nodiscard]] static bool keeps_parameters();
  [[nodiscard]] static bool read_parameters(std::span<std::uint8_t> out);
  bool write_parameters(std::span<const std::uint8_t> in);

  // ResetPort
  [[nodiscard]] static firmware::ResetReport reset_report() { return cortex_m::reset_report(); }
  [[nodiscard]] static std::span<std::uint32_t> kept_words() { return cortex_m::kept_words(); }

  // LinkPort
  firmware::LinkBuffers& link() { return link_; }
  void poll_receive() { wire_.poll_receive(); }
  void start_transmit() {
    wire_.start_transmit();
    guard_.note_background();
  }

 private:
  firmware::LinkBuffers link_{};
  stm32g4::Timebase timebase_;
  stm32g4::Encoders encoders_;
  stm32g4::CurrentSetpoints setpoints_;
  stm32g4::CurrentMonitors monitors_;
  stm32g4::SupplyMonitor supply_;
  BoardWire wire_;

  stm32g4::TickGuard guard_;
  std::array<float, 3> setpoint_A_{};
  std::atomic<bool> enabled_{false};  // written by the interrupt
  bool emergency_stop_open_ = true;
};

template <class Due>
void NucleoG474re::idle(Due due) {
  wire_.idle();
  cortex_m::idle_unless([&] { return due() || wire_.has_work(); });
}

}  // namespace palpate::board
