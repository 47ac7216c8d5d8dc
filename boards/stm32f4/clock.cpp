#include "boards/stm32f4/clock.hpp"

#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32f4/registers.hpp"

namespace palpate::stm32f4 {
namespace {

constexpr std::uint32_t kLatency_waits = 5;               // 2.7 to 3.6 V, up to 168 MHz (RM0090, table 10)
constexpr std::uint32_t kSwitchPll = 2;                   // RCC_CFGR.SW
constexpr std::uint32_t kByTwo = 4, kByFour = 5;          // RCC_CFGR.PPREx
constexpr std::uint32_t kByCrystal = 6, kByInternal = 8;  // RCC_PLLCFGR.PLLM: to 2 MHz
constexpr std::uint32_t kTimes = 168, kUsbBy = 7;         // PLLN, PLLQ; PLLP = 0 is by 2
static_assert(12'000'000 / kByCrystal * kTimes / 2 == kSystemClock_Hz);
static_assert(16'000'000 / kByInternal * kTimes / 2 == kSystemClock_Hz);

// A crystal takes some 2 ms; at 16 MHz and four cycles a look this is 25 ms at least.
constexpr std::uint32_t kCrystalLooks = 100'000;

}  // namespace

ClockSource start_clock() {
  switch_on(RCC[rcc::APB1ENR], rcc::APB1ENR_PWREN);
  set(PWR[pwr::CR], pwr::CR_VOS);
  set(RCC[rcc::CR], rcc::CR_HSEON);
  const bool has_crystal = wait_until([] { return is_set(RCC[rcc::CR], rcc::CR_HSERDY); }, kCrystalLooks);
  if (!has_crystal) clear(RCC[rcc::CR], rcc::CR_HSEON);

  FLASH[flash::ACR] =
      flash::ACR_LATENCY.of(kLatency_waits) | flash::ACR_PRFTEN | flash::ACR_ICEN | flash::ACR_DCEN;
  require(wait_until([] { return get(FLASH[flash::ACR], flash::ACR_LATENCY) == kLatency_waits; }),
          FLASH[flash::ACR]);

  RCC[rcc::PLLCFGR] = rcc::PLLCFGR_PLLSRC.of(has_crystal ? 1 : 0) |
                      rcc::PLLCFGR_PLLM.of(has_crystal ? kByCrystal : kByInternal) |
                      rcc::PLLCFGR_PLLN.of(kTimes) | rcc::PLLCFGR_PLLP.of(0) | rcc::PLLCFGR_PLLQ.of(kUsbBy);
  put(RCC[rcc::CFGR], rcc::CFGR_PPRE1, kByFour);
  put(RCC[rcc::CFGR], rcc::CFGR_PPRE2, kByTwo);
  set(RCC[rcc::CR], rcc::CR_PLLON);
  require(wait_until([] { return is_set(RCC[rcc::CR], rcc::CR_PLLRDY); }), RCC[rcc::CR]);
  put(RCC[rcc::CFGR], rcc::CFGR_SW, kSwitchPll);
  require(wait_until([] { return get(RCC[rcc::CFGR], rcc::CFGR_SWS) == kSwitchPll; }), RCC[rcc::CFGR]);
  if (has_crystal) set(RCC[rcc::CR], rcc::CR_CSSON);
  return has_crystal ? ClockSource::crystal : ClockSource::internal;
}

std::uint32_t reset_causes() {
  const std::uint32_t causes = RCC[rcc::CSR];
  set(RCC[rcc::CSR], rcc::CSR_RMVF);
  return causes;
}

}  // namespace palpate::stm32f4
