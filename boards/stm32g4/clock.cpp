#include "boards/stm32g4/clock.hpp"

#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {
namespace {

constexpr std::uint32_t kLatency_waits = 4;  // range 1 boost: up to 170 MHz
constexpr std::uint32_t kSwitchPll = 3;      // RCC_CFGR.SW
constexpr std::uint32_t kHalf = 8;           // RCC_CFGR.HPRE
// 24 MHz / 6 or 16 MHz / 4 are 4 MHz; times 85, by 2.
constexpr std::uint32_t kPllTimes = 85;
constexpr std::uint32_t kPllByCrystal = 6, kPllByInternal = 4;
constexpr std::uint32_t kPllFromInternal = 2, kPllFromCrystal = 3;  // RCC_PLLCFGR.PLLSRC
static_assert(24'000'000 / kPllByCrystal * kPllTimes / 2 == kSystemClock_Hz);
static_assert(16'000'000 / kPllByInternal * kPllTimes / 2 == kSystemClock_Hz);
constexpr std::uint32_t kSyncFromUsb = 2;  // CRS_CFGR.SYNCSRC

// A crystal takes some 2 ms; at 16 MHz and four cycles a look this is 25 ms at least.
constexpr std::uint32_t kCrystalLooks = 100'000;

}  // namespace

ClockSource start_clock() {
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_PWREN);
  set(PWR[pwr::CR3], pwr::CR3_UCPD1_DBDIS);

  set(RCC[rcc::CR], rcc::CR_HSEON);
  const bool has_crystal = wait_until([] { return is_set(RCC[rcc::CR], rcc::CR_HSERDY); }, kCrystalLooks);
  if (!has_crystal) clear(RCC[rcc::CR], rcc::CR_HSEON);

  clear(PWR[pwr::CR5], pwr::CR5_R1MODE);
  FLASH[flash::ACR] = (FLASH[flash::ACR] & ~flash::ACR_LATENCY.mask()) |
                      flash::ACR_LATENCY.of(kLatency_waits) | flash::ACR_PRFTEN | flash::ACR_ICEN |
                      flash::ACR_DCEN;
  require(wait_until([] { return get(FLASH[flash::ACR], flash::ACR_LATENCY) == kLatency_waits; }),
          FLASH[flash::ACR]);

  RCC[rcc::PLLCFGR] = rcc::PLLCFGR_PLLSRC.of(has_crystal ? kPllFromCrystal : kPllFromInternal) |
                      rcc::PLLCFGR_PLLM.of((has_crystal ? kPllByCrystal : kPllByInternal) - 1) |
                      rcc::PLLCFGR_PLLN.of(kPllTimes) | rcc::PLLCFGR_PLLREN;
  set(RCC[rcc::CR], rcc::CR_PLLON);
  require(wait_until([] { return is_set(RCC[rcc::CR], rcc::CR_PLLRDY); }), RCC[rcc::CR]);
  put(RCC[rcc::CFGR], rcc::CFGR_HPRE, kHalf);
  put(RCC[rcc::CFGR], rcc::CFGR_SW, kSwitchPll);
  require(wait_until([] { return get(RCC[rcc::CFGR], rcc::CFGR_SWS) == kSwitchPll; }), RCC[rcc::CFGR]);
  // 1 us at half the clock is 85 cycles: 85 turns take longer.
  for (int i = 0; i < 85; ++i) asm volatile("nop");
  put(RCC[rcc::CFGR], rcc::CFGR_HPRE, 0);
  if (has_crystal) set(RCC[rcc::CR], rcc::CR_CSSON);
  return has_crystal ? ClockSource::crystal : ClockSource::internal;
}

std::uint32_t reset_causes() {
  const std::uint32_t causes = RCC[rcc::CSR];
  set(RCC[rcc::CSR], rcc::CSR_RMVF);
  return causes;
}

void start_usb_clock() {
  set(RCC[rcc::CRRCR], rcc::CRRCR_HSI48ON);
  require(wait_until([] { return is_set(RCC[rcc::CRRCR], rcc::CRRCR_HSI48RDY); }), RCC[rcc::CRRCR]);
  put(RCC[rcc::CCIPR], rcc::CCIPR_CLK48SEL, 0);
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_CRSEN);
  // 48,000 clocks from frame to frame: what reset leaves in RELOAD and FELIM.
  put(CRS[crs::CFGR], crs::CFGR_SYNCSRC, kSyncFromUsb);
  set(CRS[crs::CR], crs::CR_CEN | crs::CR_AUTOTRIMEN);
}

}  // namespace palpate::stm32g4
