// Bit timing of FDCAN: 1 Mbit/s, and 5 Mbit/s for the data of an FD frame, both exact on 170 MHz.
//
// One time quantum is one clock. Samples are taken at 80 % and 79 % of the bit; FD adds the transceiver's
// delay as measured by the controller (TDC) to its own second sample.
#pragma once

#include <cstdint>

#include "boards/stm32g4/clock.hpp"

namespace palpate::stm32g4 {

// Quanta: one of synchronization, then these.
struct BitTiming {
  std::uint32_t before_sample, after_sample, jump_width;

  [[nodiscard]] constexpr std::uint32_t rate_Hz() const {
    return kSystemClock_Hz / (1 + before_sample + after_sample);
  }
};
inline constexpr BitTiming kNominalBit{.before_sample = 135, .after_sample = 34, .jump_width = 34};
inline constexpr BitTiming kDataBit{.before_sample = 26, .after_sample = 7, .jump_width = 7};
static_assert(kNominalBit.rate_Hz() == 1'000'000 && kSystemClock_Hz % 1'000'000 == 0);
static_assert(kDataBit.rate_Hz() == 5'000'000 && kSystemClock_Hz % 5'000'000 == 0);

}  // namespace palpate::stm32g4
