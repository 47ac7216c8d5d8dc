// What lies under the emulated board on QEMU's MPS2 boards (boards/lockstep/emulated_board.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "boards/lockstep/exchange.hpp"
#include "boards/mps2/registers.hpp"
#include "boards/mps2/semihosting.hpp"
#include "firmware/core/supervisor.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::board {

// With the command line "uart" (QEMU: -semihosting-config arg=uart) there is no plant and the link runs over
// UART1; with another, that is what start_times.hpp says. But for "uart" the plant and the link's bytes cross
// through the files act.fifo and sen.fifo in QEMU's working directory.
class Mps2Platform {
 public:
  // Opens the exchange; blocks until the plant has opened its ends. `limits` are changed as the command line
  // says; ends the run with ExitCode::usage where it says what cannot be.
  void begin(firmware::Limits& limits);

  bool has_plant() const { return has_plant_; }
  bool read_sensors(std::span<std::byte> bytes) { return semihosting::read_all(sensors_, bytes); }
  bool write_actuators(std::span<const std::byte> bytes) { return semihosting::write_all(actuators_, bytes); }
  void exit(lockstep::ExitCode code) { semihosting::exit(static_cast<int>(code)); }

  // TIMER1 counts 25 MHz downwards, from 2^32 - 1.
  std::uint32_t clock_count() const { return ~timer1().value; }
  std::uint32_t clock_Hz() const { return kSystemClock_Hz; }
  std::uint32_t first_due_count() const { return first_due_count_; }
  // Starts the clock and the servo interrupt.
  void start_ticks();

  void burn();
  void crash();
  [[noreturn]] void reset();

  void transmit(firmware::LinkBuffers& link);
  // Receive interrupt of UART1.
  void isr_receive(firmware::LinkBuffers& link);

  // Passes the time until the next interrupt.
  void idle();

 private:
  bool has_plant_ = true;
  std::uint32_t first_due_count_ = 0;
  std::int32_t actuators_ = semihosting::kNoHandle;
  std::int32_t sensors_ = semihosting::kNoHandle;
};

}  // namespace palpate::board
