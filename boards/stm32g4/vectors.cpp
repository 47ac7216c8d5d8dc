// Vector table. A handler that an image does not define is that of an interrupt nobody asked for.
#include <array>

#include "boards/cortex_m/start_up.hpp"
#include "boards/stm32g4/registers.hpp"

extern "C" {
// Defined in handlers.cpp and by the board.
void unexpected_handler();
void nmi_handler();
void hard_fault_handler();
void tim7_handler();
[[gnu::weak, gnu::alias("unexpected_interrupt")]] void dma1_channel1_handler() noexcept;
[[gnu::weak, gnu::alias("unexpected_interrupt")]] void dma1_channel2_handler() noexcept;
[[gnu::weak, gnu::alias("unexpected_interrupt")]] void fdcan2_handler() noexcept;
[[gnu::weak, gnu::alias("unexpected_interrupt")]] void usb_low_priority_handler() noexcept;

// An alias must name a function of the same file.
[[gnu::naked]] void unexpected_interrupt() noexcept {
  asm volatile("b unexpected_handler");
}
}

namespace palpate::stm32g4 {
namespace {

using board::kSystemVectors;
using board::Vector;

constexpr std::array<Vector, kSystemVectors + kInterrupts> make_vectors() {
  std::array<Vector, kSystemVectors + kInterrupts> table{};
  for (Vector& vector : table) vector.handler = unexpected_interrupt;
  table[0].stack = &palpate_stack_top;
  table[1].handler = reset_handler;
  table[2].handler = nmi_handler;
  table[3].handler = hard_fault_handler;  // MemManage, BusFault and UsageFault stay disabled, escalate to it
  table[kSystemVectors + interrupt::DMA1_CH1].handler = dma1_channel1_handler;
  table[kSystemVectors + interrupt::DMA1_CH2].handler = dma1_channel2_handler;
  table[kSystemVectors + interrupt::USB_LP].handler = usb_low_priority_handler;
  table[kSystemVectors + interrupt::TIM7].handler = tim7_handler;
  table[kSystemVectors + interrupt::FDCAN2_IT0].handler = fdcan2_handler;
  return table;
}
[[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors = make_vectors();

}  // namespace
}  // namespace palpate::stm32g4
