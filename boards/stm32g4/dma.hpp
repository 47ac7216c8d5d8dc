// Channels of DMA1. Registers: RCC_AHB1ENR.DMA1EN and DMAMUX1EN; DMAMUX_CxCR; CPARx, CMARx, CNDTRx; CCRx, its
// EN last. Buffers lie in .bss.dma, which the linker puts into SRAM1.
#pragma once

#include <cstdint>

#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

// Who has which: numbers as in the manual, from 1.
inline constexpr std::uint32_t kReceiveChannel = 1;
inline constexpr std::uint32_t kTransmitChannel = 2;
inline constexpr std::uint32_t kMonitorChannel = 3;

// RM0440, table 91.
enum class DmaRequest : std::uint32_t { adc1 = 5, lpuart1_receive = 34, lpuart1_transmit = 35 };

// A register of a channel, by that of channel 1.
inline Register& of_channel(std::uint32_t channel, Offset first) {
  return DMA1[{first.bytes + dma::kChannelBytes * (channel - 1)}];
}
// A flag of a channel, by that of channel 1.
constexpr Bits of_channel(std::uint32_t channel, Bits first) {
  return {first.position + dma::kChannelFlags * (channel - 1), first.width};
}

struct DmaTransfer {
  std::uint32_t channel;
  DmaRequest request;
  const volatile std::uint32_t* peripheral;
  const volatile void* memory;
  std::uint32_t items;
  std::uint32_t item_bytes = 1;  // or 2
  bool to_peripheral = false;
  bool circular = false;
  std::uint32_t interrupts = 0;  // dma::CCR1_TCIE and others
};

inline std::uint32_t dma_address(const volatile void* memory) {
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(memory));
}

// Sets a channel up; it begins if there are any items.
inline void start_dma(const DmaTransfer& transfer) {
  switch_on(RCC[rcc::AHB1ENR], rcc::AHB1ENR_DMA1EN | rcc::AHB1ENR_DMAMUX1EN);
  const std::uint32_t size = transfer.item_bytes == 2 ? 1 : 0;
  DMAMUX[{dmamux::C0CR.bytes + 4 * (transfer.channel - 1)}] =
      dmamux::C0CR_DMAREQ_ID.of(static_cast<std::uint32_t>(transfer.request));
  Register& control = of_channel(transfer.channel, dma::CCR1);
  control = (transfer.to_peripheral ? dma::CCR1_DIR.mask() : 0) |
            (transfer.circular ? dma::CCR1_CIRC.mask() : 0) | dma::CCR1_MINC.mask() |
            dma::CCR1_PSIZE.of(size) | dma::CCR1_MSIZE.of(size) | transfer.interrupts;
  of_channel(transfer.channel, dma::CPAR1) = dma_address(transfer.peripheral);
  of_channel(transfer.channel, dma::CMAR1) = dma_address(transfer.memory);
  of_channel(transfer.channel, dma::CNDTR1) = transfer.items;
  if (transfer.items != 0) set(control, dma::CCR1_EN);
}

// A one-way channel once more, when it has ended.
inline void restart_dma(std::uint32_t channel, std::uint32_t items) {
  Register& control = of_channel(channel, dma::CCR1);
  clear(control, dma::CCR1_EN);
  of_channel(channel, dma::CNDTR1) = items;
  set(control, dma::CCR1_EN);
}

}  // namespace palpate::stm32g4
