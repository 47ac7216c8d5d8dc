// The link on LPUART1, both ways by DMA: a servo tick keeps link interrupts out for longer than the UART's 8
// bytes last (87 us at 921,600 baud).
//
// Registers: RCC_CCIPR.LPUART1SEL = PCLK1; RCC_APB1ENR2.LPUART1EN; LPUART1_BRR, CR3 (DMA both ways, no
// overrun), CR1 (FIFO, TE, RE, UE); DMA1 channel 1 in a circle with interrupts at its half and end, channel 2
// with one at its end. Read: DMA1_CNDTR1. Interrupts: DMA1_CH1, DMA1_CH2.
#pragma once

#include <cstdint>

#include "firmware/ports/ports.hpp"

namespace palpate::stm32g4 {

inline constexpr std::uint32_t kBaud = 921'600;

class LpuartLink {
 public:
  explicit LpuartLink(firmware::LinkBuffers& link) : link_(link) {}

  // The pins are the board's.
  void begin();
  // Background: bytes that have come since the last interrupt.
  void poll_receive();
  void start_transmit();
  // Background, when there is nothing else to do: nothing here, interrupts do it all.
  void idle() {}
  [[nodiscard]] bool has_work() const { return false; }

  // Link interrupts.
  void isr_receive();
  void isr_transmitted();

 private:
  void drain();
  void fill();

  firmware::LinkBuffers& link_;
  std::uint32_t read_ = 0;  // in the circle
  bool sending_ = false;
};

}  // namespace palpate::stm32g4
