// The supply of the part, watched by its own comparator (programmable voltage detector).
//
// Registers: PWR_CR2.PVDLS and PVDE, after RCC_APB1ENR1.PWREN (clock.hpp); then SR2.PVDO. Below 1.7 V the
// part resets itself, and RCC_CSR.BORRSTF says so.
#pragma once

#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

class SupplyMonitor {
 public:
  // The highest threshold of the part, about 2.9 V falling. Set-points and monitors are shares of the supply:
  // 0 A, half of it, is then 0.2 V from the amplifiers' 1.65 V.
  static constexpr std::uint32_t kThreshold = 6;

  static void start() {
    put(PWR[pwr::CR2], pwr::CR2_PVDLS, kThreshold);
    set(PWR[pwr::CR2], pwr::CR2_PVDE);
  }
  // Interrupt context, once a tick.
  void isr_latch() { is_low_ = is_set(PWR[pwr::SR2], pwr::SR2_PVDO); }
  [[nodiscard]] bool isr_is_low() const { return is_low_; }

 private:
  bool is_low_ = true;
};

}  // namespace palpate::stm32g4
