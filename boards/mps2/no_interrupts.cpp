// Handlers of the images that run without interrupts: the golden trace and the benchmark.
#include "boards/lockstep/exchange.hpp"
#include "boards/mps2/semihosting.hpp"

extern "C" {

// Start-up's vectors name these; no interrupt is enabled here, so that any of them is an error.
[[noreturn]] void hard_fault_handler() {
  palpate::board::semihosting::exit(static_cast<int>(palpate::lockstep::ExitCode::processor_fault));
}
void timer0_handler() {
  hard_fault_handler();
}
void uart1_receive_handler() {
  hard_fault_handler();
}

}  // extern "C"
