#include "boards/stm32g4/lpuart_link.hpp"

#include <array>

#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/dma_circle.hpp"
#include "boards/stm32g4/clock.hpp"
#include "boards/stm32g4/dma.hpp"
#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {
namespace {

// An interrupt each 128 bytes: 1.4 ms at 921,600 baud, and as long again until they are overwritten. A servo
// tick keeps it waiting for less than 1 ms.
constexpr std::uint32_t kCircle_bytes = 256;
constexpr std::uint32_t kSend_bytes = 256;
[[gnu::section(".bss.dma")]] std::array<std::uint8_t, kCircle_bytes> received;
[[gnu::section(".bss.dma")]] std::array<std::uint8_t, kSend_bytes> to_send;

// LPUART_BRR: 256 times the clock by the rate, rounded.
constexpr std::uint32_t kBaudDivider =
    static_cast<std::uint32_t>((256ull * kSystemClock_Hz + kBaud / 2) / kBaud);

// Set before the interrupts come on.
LpuartLink* the_link = nullptr;

}  // namespace

void LpuartLink::begin() {
  the_link = this;
  put(RCC[rcc::CCIPR], rcc::CCIPR_LPUART1SEL, 0);
  switch_on(RCC[rcc::APB1ENR2], rcc::APB1ENR2_LPUART1EN);
  LPUART1[lpuart::BRR] = kBaudDivider;
  // An overrun would stop reception; without, a byte is lost, and the framing notices.
  LPUART1[lpuart::CR3] = lpuart::CR3_DMAR | lpuart::CR3_DMAT | lpuart::CR3_OVRDIS;
  start_dma({.channel = kReceiveChannel,
             .request = DmaRequest::lpuart1_receive,
             .peripheral = &LPUART1[lpuart::RDR],
             .memory = received.data(),
             .items = kCircle_bytes,
             .circular = true,
             .interrupts = dma::CCR1_HTIE | dma::CCR1_TCIE});
  start_dma({.channel = kTransmitChannel,
             .request = DmaRequest::lpuart1_transmit,
             .peripheral = &LPUART1[lpuart::TDR],
             .memory = to_send.data(),
             .items = 0,
             .to_peripheral = true,
             .interrupts = dma::CCR1_TCIE.mask()});
  LPUART1[lpuart::CR1] = lpuart::CR1_FIFOEN | lpuart::CR1_TE | lpuart::CR1_RE | lpuart::CR1_UE;
  enable_interrupt(interrupt::DMA1_CH1, kLinkPriority);
  enable_interrupt(interrupt::DMA1_CH2, kLinkPriority);
}

void LpuartLink::poll_receive() {
  const Masked masked(interrupt::DMA1_CH1);
  drain();
}

void LpuartLink::start_transmit() {
  const Masked masked(interrupt::DMA1_CH2);
  if (!sending_) fill();
}

void LpuartLink::isr_receive() {
  DMA1[dma::IFCR] = of_channel(kReceiveChannel, dma::ISR_HTIF1) | of_channel(kReceiveChannel, dma::ISR_TCIF1);
  drain();
}

void LpuartLink::isr_transmitted() {
  DMA1[dma::IFCR] = of_channel(kTransmitChannel, dma::ISR_TCIF1).mask();
  sending_ = false;
  fill();
}

void LpuartLink::drain() {
  read_ = drain_circle(received, of_channel(kReceiveChannel, dma::CNDTR1), read_, link_);
}

void LpuartLink::fill() {
  const std::size_t count = link_.transmit.read(to_send);
  if (count == 0) return;
  dma_barrier();
  restart_dma(kTransmitChannel, static_cast<std::uint32_t>(count));
  sending_ = true;
}

}  // namespace palpate::stm32g4

extern "C" {

void dma1_channel1_handler() {
  palpate::stm32g4::the_link->isr_receive();
}

void dma1_channel2_handler() {
  palpate::stm32g4::the_link->isr_transmitted();
}

}  // extern "C"
