#include "host/session/tip_history.hpp"

namespace palpate::host {

bool TipHistory::follows(std::uint32_t tick) const {
  if (samples_.empty()) return true;
  const std::uint32_t ahead = tick - first_tick_;
  return ahead < kLongestHistory_ticks || ahead >= 0u - kOldest_ticks;
}

void TipHistory::add(std::uint32_t tick, const Vec3d& tip_m) {
  if (samples_.empty()) {
    first_tick_ = tick;
    samples_.push_back(tip_m);
    return;
  }
  if (static_cast<std::int32_t>(tick - first_tick_) < 0) return;
  const std::size_t index = tick - first_tick_;
  if (index >= kLongestHistory_ticks) return;
  if (index >= samples_.size()) samples_.resize(index + 1);
  if (!samples_[index]) samples_[index] = tip_m;
}

std::uint32_t TipHistory::complete_tick() const {
  std::uint32_t known = 0;
  while (known + 1 < samples_.size() && samples_[known + 1]) ++known;
  return first_tick_ + known;
}

std::vector<TickRange> TipHistory::gaps() const {
  std::vector<TickRange> gaps;
  for (std::uint32_t i = 1; i < samples_.size(); ++i) {
    if (samples_[i]) continue;
    if (samples_[i - 1]) gaps.push_back({first_tick_ + i, 0});
    ++gaps.back().count;
  }
  return gaps;
}

std::vector<std::uint32_t> TipHistory::interpolate_until(std::uint32_t tick) {
  std::vector<std::uint32_t> filled;
  for (const TickRange& gap : gaps()) {
    const std::uint32_t before = gap.first - 1 - first_tick_, after = before + gap.count + 1;
    if (static_cast<std::int32_t>(gap.first + gap.count - 1 - tick) > 0) break;
    const Vec3d start = *samples_[before], step = (*samples_[after] - start) * (1.0 / (gap.count + 1));
    for (std::uint32_t i = 1; i <= gap.count; ++i) {
      samples_[before + i] = start + step * static_cast<double>(i);
      filled.push_back(first_tick_ + before + i);
    }
  }
  return filled;
}

Vec3d TipHistory::at(std::uint32_t tick) const {
  return *samples_.at(tick - first_tick_);
}

void TipHistory::forget_before(std::uint32_t tick) {
  while (samples_.size() > 1 && static_cast<std::int32_t>(tick - first_tick_) > 0) {
    samples_.pop_front();
    ++first_tick_;
  }
}

}  // namespace palpate::host
