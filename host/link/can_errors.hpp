// What a CAN controller tells of its bus in error frames (linux/can/error.h).
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <string>

namespace palpate::link {

// How often each kind was told; an error frame may tell of several. Which of them a driver tells, and how
// often, is up to the driver.
struct CanErrors {
  std::uint64_t transmit_timeouts = 0;
  std::uint64_t lost_arbitrations = 0;     // not sent now; the controller tries again
  std::uint64_t controller_overflows = 0;  // its buffers: frames were lost
  std::uint64_t controller_warnings = 0;   // warning and passive: its error counters have risen
  std::uint64_t protocol_violations = 0;
  std::uint64_t transceiver_faults = 0;  // wiring
  std::uint64_t unacknowledged = 0;      // nobody else on the bus, or another bit rate
  std::uint64_t bus_errors = 0;
  std::uint64_t bus_offs = 0;
  std::uint64_t restarts = 0;       // back from bus-off
  std::uint64_t frames_missed = 0;  // the reader was too slow: the kernel dropped them
};

// Counts an error frame and keeps whether the controller is off the bus.
void count_error(const can_frame& frame, CanErrors& errors, bool& is_bus_off);

// In words, for a person; empty where nothing has gone wrong. Lost arbitrations are no error.
std::string text_of(const CanErrors& errors, bool is_bus_off);

}  // namespace palpate::link
