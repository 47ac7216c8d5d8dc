// What the last tick before a reset leaves behind, in memory that a reset does not change: so motors that
// were hot are hot still, and somebody can ask what was before. A reset that comes while the words are
// written, or memory that came up by itself, has a check that does not fit.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/motor_heat.hpp"

namespace palpate::firmware {

struct KeptTick {
  std::uint32_t tick = 0;
  std::uint32_t faults = 0;  // latched then: bits of Fault
  MotorHeat heat{};
};

inline constexpr std::size_t kKeptTickWords = sizeof(KeptTick) / sizeof(std::uint32_t);
inline constexpr std::size_t kKeptWords = 1 + kKeptTickWords;  // the check first
using KeptTickWords = std::array<std::uint32_t, kKeptTickWords>;
static_assert(sizeof(KeptTick) == sizeof(KeptTickWords));

// Not that of zeros or ones, as memory may come up.
[[nodiscard]] constexpr std::uint32_t check_of(std::span<const std::uint32_t> words) {
  std::uint32_t sum = 0x4B455054;
  for (const std::uint32_t word : words) sum = std::rotl(sum, 5) ^ word;
  return sum;
}

// Interrupt context, at the end of each tick. `kept` as a board has it: kKeptWords, or none.
inline void keep(const KeptTick& tick, std::span<std::uint32_t> kept) {
  if (kept.size() != kKeptWords) return;
  const auto words = std::bit_cast<KeptTickWords>(tick);
  kept[0] = check_of(words);
  std::copy(words.begin(), words.end(), kept.begin() + 1);
}

// Before the first tick. False, and `tick` stays as it is: there is none.
[[nodiscard]] inline bool recall(std::span<const std::uint32_t> kept, KeptTick& tick) {
  if (kept.size() != kKeptWords || kept[0] != check_of(kept.subspan(1))) return false;
  KeptTickWords words;
  std::copy(kept.begin() + 1, kept.end(), words.begin());
  tick = std::bit_cast<KeptTick>(words);
  return true;
}

}  // namespace palpate::firmware
