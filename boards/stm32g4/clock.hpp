// Clocks of the part: 170 MHz from a crystal of 24 MHz, or from the internal 16 MHz where that does not come.
//
// Registers, in this order: RCC_APB1ENR1.PWREN; PWR_CR3.UCPD1_DBDIS (or PB4 and PB6 have pull-downs);
// RCC_CR.HSEON, waits for HSERDY; PWR_CR5.R1MODE = 0 (boost, needed above 150 MHz); FLASH_ACR.LATENCY = 4,
// read back, with caches and prefetch; RCC_PLLCFGR; RCC_CR.PLLON, waits for PLLRDY; RCC_CFGR.HPRE = /2; SW =
// PLL, waits for SWS; 1 us; HPRE = /1. With the crystal RCC_CR.CSSON: should it stop, the processor runs on
// 16 MHz and gets the NMI. For USB, RCC_CRRCR.HSI48ON, waits for HSI48RDY, RCC_CCIPR.CLK48SEL = HSI48, and
// the CRS trims it by the host's frames. RM0440, 6.1.5 and 7.2.
#pragma once

#include <cstdint>

namespace palpate::stm32g4 {

inline constexpr std::uint32_t kSystemClock_Hz = 170'000'000;  // of AHB, APB1 and APB2, and of all timers

enum class ClockSource : std::uint32_t {
  crystal = 0,
  internal = 1,  // to within 1 %: enough for all but CAN
};

// Once, after reset, while the processor runs on 16 MHz.
ClockSource start_clock();
// What caused the last reset: RCC_CSR, by its bits (rcc::CSR_*RSTF). Once: it clears them.
std::uint32_t reset_causes();
// For the USB device: after start_clock().
void start_usb_clock();

}  // namespace palpate::stm32g4
