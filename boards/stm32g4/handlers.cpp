// The NMI: outputs off, a record for the next boot, reset.
#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fail_safe.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32g4/parameter_flash.hpp"
#include "boards/stm32g4/registers.hpp"

extern "C" {

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
