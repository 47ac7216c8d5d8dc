// The times of a stale model and a lost link that a run asks of an emulated board, as an argument of its
// command line: "times=HORIZON:FADE:DAMP:RESUME", in ticks; an empty field leaves what the board's folder
// says (limits.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "firmware/core/limit_ranges.hpp"

namespace palpate::board {

inline constexpr std::string_view kStartTimes = "times=";
inline constexpr std::size_t kMaxTimeDigits = 5;
inline constexpr std::size_t kMaxStartTimes = kStartTimes.size() + 4 * kMaxTimeDigits + 3;

// Without memcmp, whose stack is not known on a board.
constexpr bool is_start_times(std::string_view argument) {
  if (argument.size() < kStartTimes.size()) return false;
  for (std::size_t i = 0; i < kStartTimes.size(); ++i)
    if (argument[i] != kStartTimes[i]) return false;
  return true;
}

struct StartTime {
  std::uint32_t firmware::Limits::*ticks;
  std::uint32_t least;
  std::uint32_t most;
};
// Of limit_ranges.hpp, at compile time: its names are not for the board's memory.
consteval StartTime start_time(std::uint32_t firmware::Limits::*ticks) {
  for (const auto& range : firmware::kTickRanges)
    if (range.limit == ticks) return {ticks, range.least, range.most};
  return {};
}

// False where it is no such argument, a time is out of range, or they do not go together: `limits` are then
// not to be used.
constexpr bool take_start_times(std::string_view argument, firmware::Limits& limits) {
  using firmware::Limits;
  constexpr std::array kTimes{start_time(&Limits::model_horizon_ticks), start_time(&Limits::model_fade_ticks),
                              start_time(&Limits::damping_ticks), start_time(&Limits::link_lost_ticks)};
  if (!is_start_times(argument) || argument.size() > kMaxStartTimes) return false;
  std::size_t field = 0, digits = 0;
  std::uint32_t ticks = 0;
  for (std::size_t i = kStartTimes.size(); i <= argument.size(); ++i) {
    const bool ends = i == argument.size();
    if (!ends && argument[i] >= '0' && argument[i] <= '9') {
      if (++digits > kMaxTimeDigits) return false;
      ticks = 10 * ticks + static_cast<std::uint32_t>(argument[i] - '0');
      continue;
    }
    if (field == kTimes.size() || (!ends && argument[i] != ':')) return false;
    if (digits > 0) {
      const StartTime& time = kTimes[field];
      if (ticks < time.least || ticks > time.most) return false;
      limits.*time.ticks = ticks;
    }
    ++field;
    digits = 0;
    ticks = 0;
  }
  return field == kTimes.size() && firmware::lost_after_off(limits);
}

}  // namespace palpate::board
