// Handlers of what must not happen on any part: outputs off, a record for the next boot, reset.
#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fail_safe.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/vectors.hpp"

extern "C" {

[[noreturn, gnu::used]] void report_fault(const std::uint32_t* stacked, std::uint32_t vector) {
  using namespace palpate::cortex_m;
  constexpr std::size_t kStackedProgramCounter = 6;
  constexpr std::uint32_t kHardFault = 3;
  palpate::board::fail_safe();
  record_fault(vector == kHardFault ? FaultReason::processor : FaultReason::unexpected_interrupt, vector,
               {.program_counter = stacked[kStackedProgramCounter],
                .cfsr = SCB[scb::CFSR],
                .hfsr = SCB[scb::HFSR],
                .bfar = SCB[scb::BFAR]});
  reset_processor();
}

// Also entered by interrupts that nobody asked for.
[[gnu::naked]] void hard_fault_handler() {
  asm volatile("mrs r0, msp\n mrs r1, ipsr\n b report_fault\n");
}
[[gnu::naked]] void unexpected_handler() {
  asm volatile("b hard_fault_handler");
}

}  // extern "C"
