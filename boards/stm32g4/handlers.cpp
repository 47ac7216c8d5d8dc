// Handlers of what must not happen: outputs off, a record for the next boot, reset.
#include "boards/stm32g4/core_registers.hpp"
#include "boards/stm32g4/fail_safe.hpp"
#include "boards/stm32g4/fault_record.hpp"
#include "boards/stm32g4/parameter_flash.hpp"
#include "boards/stm32g4/registers.hpp"

extern "C" {

[[noreturn, gnu::used]] void report_fault(const std::uint32_t* stacked, std::uint32_t vector) {
  using namespace palpate::stm32g4;
  constexpr std::size_t kStackedProgramCounter = 6;
  constexpr std::uint32_t kHardFault = 3;
  palpate::board::fail_safe();
  palpate::stm32g4::record_fault(
      vector == kHardFault ? FaultReason::processor : FaultReason::unexpected_interrupt, vector,
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

// Two bits of flash are wrong, which the parameters may be, or the clock security system has found that the
// crystal has stopped: then the next boot runs without it.
void nmi_handler() {
  using namespace palpate::stm32g4;
  if (ParameterFlash::note_unreadable()) return;
  palpate::board::fail_safe();
  const bool clock_lost = is_set(RCC[rcc::CIFR], rcc::CIFR_CSSF);
  set(RCC[rcc::CICR], rcc::CICR_CSSC);
  record_fault(clock_lost ? FaultReason::clock_lost : FaultReason::flash_unreadable, FLASH[flash::ECCR]);
  reset_processor();
}

}  // extern "C"
