// 168 MHz for the processor, 42 MHz for APB1 and 84 MHz for its timers, from a crystal of 12 MHz, or from the
// internal 16 MHz where that does not come.
//
// Registers, in this order: RCC_APB1ENR.PWREN; PWR_CR.VOS = 1 (scale 1, needed above 144 MHz); RCC_CR.HSEON,
// waits for HSERDY; FLASH_ACR.LATENCY = 5, read back, with caches and prefetch; RCC_PLLCFGR; RCC_CFGR.PPRE1 =
// /4, PPRE2 = /2; RCC_CR.PLLON, waits for PLLRDY; SW = PLL, waits for SWS. With the crystal RCC_CR.CSSON:
// should it stop, the processor runs on 16 MHz and gets the NMI. RM0090, 3.5.1, 5.1.3 and 7.2.
#pragma once

#include <cstdint>

namespace palpate::stm32f4 {

inline constexpr std::uint32_t kSystemClock_Hz = 168'000'000;
inline constexpr std::uint32_t kApb1_Hz = kSystemClock_Hz / 4;
inline constexpr std::uint32_t kTimerClock_Hz = 2 * kApb1_Hz;  // of the timers on APB1

enum class ClockSource : std::uint32_t {
  crystal = 0,
  internal = 1,  // to within 1 % at room temperature
};

// Once, after reset, while the processor runs on 16 MHz.
ClockSource start_clock();
// What caused the last reset: RCC_CSR. Once: it clears the flags.
std::uint32_t reset_causes();

}  // namespace palpate::stm32f4
