// The NMI: the clock security system has found that the crystal has stopped. Outputs off, a record, and the
// next boot runs without it.
#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fail_safe.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/vectors.hpp"
#include "boards/stm32f4/registers.hpp"

extern "C" {

void nmi_handler() {
  using namespace palpate::stm32f4;
  palpate::board::fail_safe();
  const bool clock_lost = is_set(RCC[rcc::CIR], rcc::CIR_CSSF);
  set(RCC[rcc::CIR], rcc::CIR_CSSC);
  record_fault(clock_lost ? FaultReason::clock_lost : FaultReason::unexpected_interrupt, RCC[rcc::CIR]);
  reset_processor();
}

}  // extern "C"
