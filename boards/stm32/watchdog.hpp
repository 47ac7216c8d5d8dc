// The independent watchdog: resets the part when nobody has refreshed it for kWatchdog_ms, whatever the
// processor does; all pins float then, and the pull-down at the amplifiers' enable switches them off. It
// cannot be stopped. A debugger that halts the processor does not halt it, since the amplifiers would hold
// their last current.
//
// Registers: IWDG_KR = 0xCCCC (starts, with the LSI), 0x5555, PR, RLR, waits for SR.PVU and RVU = 0, KR =
// 0xAAAA; a refresh is KR = 0xAAAA. RM0440, 42.3.3; RM0090, 21.3.
#pragma once

#include "boards/stm32/registers.hpp"

namespace palpate::stm32 {

inline constexpr std::uint32_t kLsi_Hz = 32'000;  // nominal; STM32G4: 29.5 to 34 kHz, STM32F4: 17 to 47 kHz
inline constexpr std::uint32_t kWatchdog_ms = 20;

inline void refresh_watchdog() {
  IWDG[iwdg::KR] = 0xAAAA;
}

// Before the first tick. False: the registers were not taken.
[[nodiscard]] inline bool start_watchdog() {
  constexpr std::uint32_t kPrescaler = 4;  // PR = 0
  IWDG[iwdg::KR] = 0xCCCC;
  IWDG[iwdg::KR] = 0x5555;
  IWDG[iwdg::PR] = 0;
  IWDG[iwdg::RLR] = kLsi_Hz / kPrescaler * kWatchdog_ms / 1000 - 1;
  const bool taken = wait_until([] { return (IWDG[iwdg::SR] & (iwdg::SR_PVU | iwdg::SR_RVU)) == 0; });
  refresh_watchdog();
  return taken;
}

}  // namespace palpate::stm32
