// Vector table.
#include <array>

#include "boards/cortex_m/start_up.hpp"

extern "C" {
// Defined in main.cpp.
void hard_fault_handler();
void timer0_handler();
void uart1_receive_handler();
}

namespace {

using palpate::board::kSystemVectors;
using palpate::board::Vector;

// An interrupt that nobody asked for: the fault handler reports it.
[[gnu::naked]] void unexpected_handler() {
  asm volatile("b hard_fault_handler");
}

constexpr std::size_t kInterrupts = 32;

constexpr std::array<Vector, kSystemVectors + kInterrupts> make_vectors() {
  std::array<Vector, kSystemVectors + kInterrupts> table{};
  for (Vector& vector : table) vector.handler = unexpected_handler;
  table[0].stack = &palpate_stack_top;
  table[1].handler = reset_handler;
  table[3].handler =
      hard_fault_handler;  // MemManage, BusFault and UsageFault stay disabled and escalate to it
  table[kSystemVectors + 2].handler = uart1_receive_handler;
  table[kSystemVectors + 8].handler = timer0_handler;
  return table;
}
[[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors = make_vectors();

}  // namespace
