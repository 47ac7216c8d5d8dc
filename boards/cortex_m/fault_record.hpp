// What a fault leaves behind for the next boot: it is in memory that start-up does not touch, so it survives
// every reset but loss of power, after which its check does not fit.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "boards/cortex_m/register.hpp"
#include "firmware/core/kept_tick.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::cortex_m {

enum class FaultReason : std::uint32_t {
  none = 0,
  processor = 1,             // hard fault: program counter, CFSR, HFSR and BFAR tell more
  unexpected_interrupt = 2,  // detail: its position in the vector table
  clock_lost = 3,            // the crystal has stopped (clock security system)
  // Start-up: a peripheral did not become ready; detail is the address of the register that was waited for.
  not_ready = 4,
  background_stuck = 5,  // the watchdog will bite; detail: the tick
  flash_unreadable = 6,  // two wrong bits in what the processor read; detail: where, as the part says it
};

struct FaultRecord {
  std::uint32_t check = 0;  // of what follows, see fault_record.cpp
  FaultReason reason = FaultReason::none;
  std::uint32_t detail = 0;
  std::uint32_t program_counter = 0, cfsr = 0, hfsr = 0, bfar = 0;
  std::uint32_t failed_starts = 0;  // one after the other
};

// What the part says of the last reset, as it says it, and the record that was there when the processor
// came up, reason `none` where there was none. Any context; written once, by note_reset().
struct BootReport {
  std::uint32_t reset_flags = 0;
  FaultRecord fault{};
};
// The same for ResetPort of firmware/ports/ports.hpp.
firmware::ResetReport reset_report();
// Beside the record, for the last tick (firmware/core/kept_tick.hpp).
std::span<std::uint32_t> kept_words();

// First thing: takes up the record of before. reset_flags: the part's causes of the last reset.
void note_reset(std::uint32_t reset_flags);
// The start has succeeded.
void note_started();

// What the processor says of a fault.
struct ProcessorState {
  std::uint32_t program_counter = 0, cfsr = 0, hfsr = 0, bfar = 0;
};
// Writes the record for the next boot. Any context.
void record_fault(FaultReason reason, std::uint32_t detail = 0, const ProcessorState& processor = {});

// Start-up: a peripheral is not ready. Records it and resets the processor; after kMostFailedStarts one after
// the other it stops here instead, with nothing switched on, for a debugger to look at.
inline constexpr std::uint32_t kMostFailedStarts = 3;
[[noreturn]] void fail_to_start(const Register& waited_for);
inline void require(bool is_ready, const Register& waited_for) {
  if (!is_ready) fail_to_start(waited_for);
}

}  // namespace palpate::cortex_m

extern "C" {
// By these names a debugger finds them.
extern palpate::cortex_m::FaultRecord palpate_fault_record;
extern palpate::cortex_m::BootReport palpate_boot_report;
extern std::array<std::uint32_t, palpate::firmware::kKeptWords> palpate_kept_tick;
}
