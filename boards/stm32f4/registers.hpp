// Registers of the STM32F405, as far as they are used here: RM0090, chapters 3.9 (FLASH), 5.4 (PWR), 7.3
// (RCC), 10.5 (DMA), 30.6 (USART), 8.4 (GPIO) and 39.1 (unique number); interrupts: table 61. A namespace has
// the registers of the peripherals that stand before it. Timers and watchdog are in stm32/registers.hpp.
//
// Compared once, on 2026-11-23, with ST's description of the part (SVD), which is not beside the project: all
// of them are there, under these names but for fields that it has bit by bit (SW, SWS, PLLM, PLLN, PLLP) and
// for what is marked.
#pragma once

#include "boards/stm32/registers.hpp"

namespace palpate::stm32f4 {

using namespace stm32;  // what this family has as others do

inline constexpr Base RCC{0x40023800};
namespace rcc {
inline constexpr Offset CR{0x00};
inline constexpr Bits CR_HSEON{16};
inline constexpr Bits CR_HSERDY{17};
inline constexpr Bits CR_CSSON{19};
inline constexpr Bits CR_PLLON{24};
inline constexpr Bits CR_PLLRDY{25};
inline constexpr Offset PLLCFGR{0x04};
inline constexpr Bits PLLCFGR_PLLM{0, 6};
inline constexpr Bits PLLCFGR_PLLN{6, 9};
inline constexpr Bits PLLCFGR_PLLP{16, 2};
inline constexpr Bits PLLCFGR_PLLSRC{22};
inline constexpr Bits PLLCFGR_PLLQ{24, 4};
inline constexpr Offset CFGR{0x08};
inline constexpr Bits CFGR_SW{0, 2};
inline constexpr Bits CFGR_SWS{2, 2};
inline constexpr Bits CFGR_PPRE1{10, 3};
inline constexpr Bits CFGR_PPRE2{13, 3};
inline constexpr Offset CIR{0x0C};
inline constexpr Bits CIR_CSSF{7};
inline constexpr Bits CIR_CSSC{23};
inline constexpr Offset AHB1ENR{0x30};
inline constexpr Bits AHB1ENR_GPIOBEN{1};
inline constexpr Bits AHB1ENR_GPIOCEN{2};
inline constexpr Bits AHB1ENR_DMA1EN{21};
inline constexpr Offset APB1ENR{0x40};
inline constexpr Bits APB1ENR_TIM5EN{3};
inline constexpr Bits APB1ENR_TIM7EN{5};
inline constexpr Bits APB1ENR_USART3EN{18};
inline constexpr Bits APB1ENR_PWREN{28};
inline constexpr Offset CSR{0x74};
inline constexpr Bits CSR_RMVF{24};
}  // namespace rcc

inline constexpr Base PWR{0x40007000};
namespace pwr {
inline constexpr Offset CR{0x00};
inline constexpr Bits CR_VOS{14};  // not in the SVD
}  // namespace pwr

inline constexpr Base FLASH{0x40023C00};
namespace flash {
inline constexpr Offset ACR{0x00};
inline constexpr Bits ACR_LATENCY{0, 3};
inline constexpr Bits ACR_PRFTEN{8};
inline constexpr Bits ACR_ICEN{9};
inline constexpr Bits ACR_DCEN{10};
}  // namespace flash

inline constexpr Base GPIOB{0x40020400};
inline constexpr Base GPIOC{0x40020800};
namespace gpio = stm32::gpio;

inline constexpr Base USART3{0x40004800};
namespace usart {
inline constexpr Offset DR{0x04};
inline constexpr Offset BRR{0x08};
inline constexpr Offset CR1{0x0C};
inline constexpr Bits CR1_RE{2};
inline constexpr Bits CR1_TE{3};
inline constexpr Bits CR1_UE{13};
inline constexpr Offset CR3{0x14};
inline constexpr Bits CR3_DMAR{6};
inline constexpr Bits CR3_DMAT{7};
}  // namespace usart

inline constexpr Base DMA1{0x40026000};
namespace dma {
inline constexpr Offset LIFCR{0x08};
// Streams 1 and 3 are the only ones used. Of stream 0; those of stream n are kStreamBytes * n behind them.
inline constexpr Offset S0CR{0x10};
inline constexpr Bits S0CR_EN{0};
inline constexpr Bits S0CR_DIR{6, 2};
inline constexpr Bits S0CR_CIRC{8};
inline constexpr Bits S0CR_MINC{10};
inline constexpr Bits S0CR_CHSEL{25, 3};
inline constexpr Offset S0NDTR{0x14};
inline constexpr Offset S0PAR{0x18};
inline constexpr Offset S0M0AR{0x1C};
inline constexpr std::uint32_t kStreamBytes = 0x18;
inline constexpr Bits LIFCR_CFEIF3{22, 6};  // svd CFEIF3 to CTCIF3; a bit of them is reserved
}  // namespace dma

inline constexpr std::uintptr_t kUniqueId_address = 0x1FFF7A10;  // not in the SVD; 96 bits
inline constexpr std::uintptr_t kFlash_address = 0x08000000;

// Interrupts by position in the vector table.
namespace interrupt {
inline constexpr std::uint32_t TIM7 = 55;
}  // namespace interrupt
inline constexpr std::uint32_t kInterrupts = 82;

}  // namespace palpate::stm32f4
