// The servo tick and the clock that is in step with it: TIM7 interrupts at 1 kHz, TIM5 counts upwards and
// wraps after 2^32. Both are on APB1, so they cannot drift apart.
//
// Registers: TIM5_CR1.CEN; TIM7_PSC, ARR, CR1.URS and EGR.UG (loads PSC without an interrupt), SR = 0,
// DIER.UIE, NVIC, CR1.CEN; in the interrupt TIM7_SR = 0. The family switches the timers' clocks on.
#pragma once

#include <cstdint>

#include "boards/cortex_m/core_registers.hpp"
#include "boards/stm32/registers.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::stm32 {

// kTimerClock_Hz: of the timers on APB1. kInterrupt: TIM7's.
template <std::uint32_t kTimerClock_Hz, std::uint32_t kInterrupt>
class Apb1Timebase {
 public:
  // The clock: before what waits for a time.
  static void start_clock_count() { set(TIM5[tim::CR1], tim::CR1_CEN); }
  // The servo interrupt: last, when all that it uses is there.
  void start_ticks() {
    TIM7[basic_tim::PSC] = kPrescaler - 1;
    TIM7[basic_tim::ARR] = kTickClock_Hz / firmware::kServoRate_Hz - 1;
    set(TIM7[basic_tim::CR1], basic_tim::CR1_URS);
    TIM7[basic_tim::EGR] = basic_tim::EGR_UG.mask();
    acknowledge();
    TIM7[basic_tim::DIER] = basic_tim::DIER_UIE.mask();
    enable_interrupt(kInterrupt, kServoPriority);
    first_due_count_ = clock_count() + kTimerClock_Hz / firmware::kServoRate_Hz;
    set(TIM7[basic_tim::CR1], basic_tim::CR1_CEN);
  }
  static void acknowledge() { TIM7[basic_tim::SR] = 0; }

  static std::uint32_t clock_count() { return TIM5[tim::CNT]; }
  [[nodiscard]] std::uint32_t first_due_count() const { return first_due_count_; }

  // Start-up.
  static void wait_us(std::uint32_t time_us) {
    const std::uint32_t begin = clock_count();
    (void)wait_until([&] { return clock_count() - begin >= time_us * (kTimerClock_Hz / 1'000'000); },
                     time_us * (kTimerClock_Hz / 1'000'000));
  }

 private:
  static constexpr std::uint32_t kPrescaler = 10;
  static constexpr std::uint32_t kTickClock_Hz = kTimerClock_Hz / kPrescaler;
  static_assert(kTimerClock_Hz % (kPrescaler * firmware::kServoRate_Hz) == 0);
  static_assert(kTickClock_Hz / firmware::kServoRate_Hz <= 65'536);

  std::uint32_t first_due_count_ = 0;
};

}  // namespace palpate::stm32
