// The tip's path as the host knows it: samples of servo ticks, which may arrive late, twice, or not at all.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "shared/math/linear.hpp"

namespace palpate::host {

struct TickRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

// A tick this far ahead of those that are held begins another history.
inline constexpr std::size_t kLongestHistory_ticks = 60'000;
// So does one this long before them: a board says again what is a quarter of a second old, not more.
inline constexpr std::uint32_t kOldest_ticks = 2'000;

class TipHistory {
 public:
  // Is it a tick of this history? Otherwise the board has started again, or nothing was heard for a minute.
  [[nodiscard]] bool follows(std::uint32_t tick) const;
  // Ticks before the first sample seen, and ticks already consumed, are ignored; so are repeats and ticks
  // beyond kLongestHistory_ticks.
  void add(std::uint32_t tick, const Vec3d& tip_m);

  [[nodiscard]] bool empty() const { return samples_.empty(); }
  // Oldest tick held, and the newest up to which no tick is missing. Only when not empty.
  [[nodiscard]] std::uint32_t first_tick() const { return first_tick_; }
  [[nodiscard]] std::uint32_t complete_tick() const;
  // Ticks that are missing although later ones have come.
  [[nodiscard]] std::vector<TickRange> gaps() const;
  // Fills every gap that ends at or before `tick` by a straight line between its neighbours. Returns the
  // ticks filled.
  std::vector<std::uint32_t> interpolate_until(std::uint32_t tick);
  // Only for first_tick() <= tick <= complete_tick().
  [[nodiscard]] Vec3d at(std::uint32_t tick) const;
  // Forgets ticks before `tick`, except the newest sample.
  void forget_before(std::uint32_t tick);

 private:
  std::uint32_t first_tick_ = 0;
  std::deque<std::optional<Vec3d>> samples_;  // of first_tick_, first_tick_ + 1, ...; the last one is known
};

}  // namespace palpate::host
