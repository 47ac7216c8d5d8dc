// The vector table of a Cortex-M, made of the handlers that an image has. Its own file puts it into .vectors:
//
//   [[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors = cortex_m::vectors<N>({{number,
//   handler}});
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "boards/cortex_m/start_up.hpp"

extern "C" {
// Of the part: what its NMI means.
void nmi_handler();
// fault_handlers.cpp.
void hard_fault_handler();
void unexpected_handler();
}

namespace palpate::cortex_m {

struct InterruptHandler {
  std::uint32_t number;  // position behind the system's vectors
  board::Handler handler;
};

// Interrupts that are not in the list are those nobody asked for. MemManage, BusFault and UsageFault stay
// disabled, and escalate to the hard fault.
template <std::size_t kInterrupts>
consteval std::array<board::Vector, board::kSystemVectors + kInterrupts> vectors(
    std::initializer_list<InterruptHandler> handlers) {
  std::array<board::Vector, board::kSystemVectors + kInterrupts> table{};
  for (board::Vector& vector : table) vector.handler = unexpected_handler;
  table[0].stack = &palpate_stack_top;
  table[1].handler = reset_handler;
  table[2].handler = nmi_handler;
  table[3].handler = hard_fault_handler;
  for (const InterruptHandler& one : handlers)
    table[board::kSystemVectors + one.number].handler = one.handler;
  return table;
}

}  // namespace palpate::cortex_m
