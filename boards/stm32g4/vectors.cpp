// Vector table. A handler that an image does not define is that of an interrupt nobody asked for.
#include "boards/cortex_m/vectors.hpp"

#include "boards/stm32g4/registers.hpp"

extern "C" {
// Defined by the board.
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

[[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors =
    vectors<kInterrupts>({{interrupt::DMA1_CH1, dma1_channel1_handler},
                          {interrupt::DMA1_CH2, dma1_channel2_handler},
                          {interrupt::USB_LP, usb_low_priority_handler},
                          {interrupt::TIM7, tim7_handler},
                          {interrupt::FDCAN2_IT0, fdcan2_handler}});

}  // namespace
}  // namespace palpate::stm32g4
