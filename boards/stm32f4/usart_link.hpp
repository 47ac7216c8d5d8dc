// The link on USART3, both ways by DMA and without interrupts: the background, which comes round once a tick,
// takes what has come and starts what is to go. At 92 bytes a millisecond a circle of 512 lasts 5 ticks.
//
// Registers: RCC_AHB1ENR.DMA1EN, RCC_APB1ENR.USART3EN; USART3_BRR, CR3 (DMA both ways), CR1 (TE, RE, UE);
// DMA1 stream 1 in a circle, stream 3 once for each piece, both channel 4 (RM0090, table 42). Read:
// DMA1_SxNDTR, DMA1_S3CR.EN, which goes off when a piece has been sent.
#pragma once

#include <cstdint>

#include "firmware/ports/ports.hpp"

namespace palpate::stm32f4 {

inline constexpr std::uint32_t kBaud = 921'600;

class UsartLink {
 public:
  explicit UsartLink(firmware::LinkBuffers& link) : link_(link) {}

  // The pins are the board's.
  void begin();
  // Background.
  void poll_receive();
  void start_transmit();

 private:
  firmware::LinkBuffers& link_;
  std::uint32_t read_ = 0;  // in the circle
};

}  // namespace palpate::stm32f4
