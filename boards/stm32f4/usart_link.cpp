#include "boards/stm32f4/usart_link.hpp"

#include <array>

#include "boards/cortex_m/dma_circle.hpp"
#include "boards/stm32f4/clock.hpp"
#include "boards/stm32f4/registers.hpp"

namespace palpate::stm32f4 {
namespace {

constexpr std::uint32_t kReceiveStream = 1, kTransmitStream = 3, kChannel = 4;
constexpr std::uint32_t kToMemory = 0, kToPeripheral = 1;  // DMA_SxCR.DIR
// Stream 3's flags, which must be clear before it starts (RM0090, 10.3.17).
constexpr std::uint32_t kTransmitFlags = dma::LIFCR_CFEIF3.mask() & ~(1u << 23);

constexpr std::uint32_t kCircle_bytes = 512;
constexpr std::uint32_t kSend_bytes = 256;
std::array<std::uint8_t, kCircle_bytes> received;
std::array<std::uint8_t, kSend_bytes> to_send;

// USART_BRR: the clock by the rate, rounded; 0.9 % slow at 921,600 baud of 42 MHz.
constexpr std::uint32_t kBaudDivider = (kApb1_Hz + kBaud / 2) / kBaud;
static_assert(kApb1_Hz / kBaudDivider * 100 > kBaud * 99 && kApb1_Hz / kBaudDivider * 100 < kBaud * 101);

Register& of_stream(std::uint32_t stream, Offset first) {
  return DMA1[{first.bytes + dma::kStreamBytes * stream}];
}

std::uint32_t address_of(const volatile void* at) {
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(at));
}

void set_up(std::uint32_t stream, std::uint32_t direction, std::uint32_t mode, const volatile void* memory) {
  of_stream(stream, dma::S0PAR) = address_of(&USART3[usart::DR]);
  of_stream(stream, dma::S0M0AR) = address_of(memory);
  of_stream(stream, dma::S0CR) =
      dma::S0CR_CHSEL.of(kChannel) | dma::S0CR_DIR.of(direction) | dma::S0CR_MINC | mode;
}

}  // namespace

void UsartLink::begin() {
  switch_on(RCC[rcc::AHB1ENR], rcc::AHB1ENR_DMA1EN);
  switch_on(RCC[rcc::APB1ENR], rcc::APB1ENR_USART3EN);
  USART3[usart::BRR] = kBaudDivider;
  USART3[usart::CR3] = usart::CR3_DMAR | usart::CR3_DMAT;
  set_up(kReceiveStream, kToMemory, dma::S0CR_CIRC.mask(), received.data());
  set_up(kTransmitStream, kToPeripheral, 0, to_send.data());
  of_stream(kReceiveStream, dma::S0NDTR) = kCircle_bytes;
  set(of_stream(kReceiveStream, dma::S0CR), dma::S0CR_EN);
  USART3[usart::CR1] = usart::CR1_TE | usart::CR1_RE | usart::CR1_UE;
}

void UsartLink::poll_receive() {
  read_ = cortex_m::drain_circle(received, of_stream(kReceiveStream, dma::S0NDTR), read_, link_);
}

void UsartLink::start_transmit() {
  if (is_set(of_stream(kTransmitStream, dma::S0CR), dma::S0CR_EN)) return;
  const std::size_t count = link_.transmit.read(to_send);
  if (count == 0) return;
  DMA1[dma::LIFCR] = kTransmitFlags;
  of_stream(kTransmitStream, dma::S0NDTR) = static_cast<std::uint32_t>(count);
  cortex_m::dma_barrier();
  set(of_stream(kTransmitStream, dma::S0CR), dma::S0CR_EN);
}

}  // namespace palpate::stm32f4
