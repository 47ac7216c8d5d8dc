// What lies under the emulated board when the firmware runs as a Linux process
// (boards/lockstep/emulated_board.hpp).
#pragma once

#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "boards/lockstep/exchange.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::board {

// Either in lock-step with a plant over two files (FIFOs), without a clock of its own; or in real time with
// the link on a pseudo-terminal and no plant, with the machine's monotonic clock.
class NativePlatform {
 public:
  static constexpr std::uint32_t kClock_Hz = 1'000'000;

  // Both block until the other end is open, and exit the process with ExitCode::no_channel when a file cannot
  // be opened.
  // `times`: of start_times.hpp, for the process that a reset starts; empty: none.
  static NativePlatform in_lockstep(const std::string& actuator_path, const std::string& sensor_path,
                                    const std::string& times);
  static NativePlatform on_pseudo_terminal();

  [[nodiscard]] bool has_plant() const { return terminal_ < 0; }
  bool read_sensors(std::span<std::byte> bytes);
  bool write_actuators(std::span<const std::byte> bytes);
  void exit(lockstep::ExitCode code) { std::_Exit(static_cast<int>(code)); }

  [[nodiscard]] std::uint32_t clock_count() const;
  [[nodiscard]] std::uint32_t clock_Hz() const { return has_plant() ? 0 : kClock_Hz; }
  [[nodiscard]] std::uint32_t first_due_count() const { return first_due_count_; }
  // Sleeps until the next tick is due. Late, it returns at once, and passes over all due times but the
  // newest, as a timer does that remembers one interrupt. The first call starts the clock.
  void wait_for_tick();

  // Without a clock no tick can be too long.
  void burn() {}
  void crash() { std::raise(SIGSEGV); }
  // The process begins anew and opens the two files again. In lock-step only.
  [[noreturn]] void reset();

  void transmit(firmware::LinkBuffers& link);
  // Bytes from the pseudo-terminal to the ring.
  void receive(firmware::LinkBuffers& link);
  // Path of the terminal that a client opens.
  [[nodiscard]] std::string terminal_path() const;

 private:
  std::int64_t due_ns_ = 0;  // of the newest tick, on the monotonic clock; 0: none yet
  std::uint32_t first_due_count_ = 0;
  std::string actuator_path_, sensor_path_, times_;
  int actuators_ = -1;
  int sensors_ = -1;
  int terminal_ = -1;
  int client_ = -1;  // our own hold of the client's end: without it the terminal hangs up between clients
};

}  // namespace palpate::board
