// Bytes that come later than the medium alone would bring them: a delay, and jitter on it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <random>
#include <utility>
#include <vector>

namespace palpate::link {

// In the ticks from first_tick on, before end_tick, what is submitted waits for delay_ticks, and up to
// jitter_ticks more, drawn for each submission.
struct Delay {
  std::uint32_t delay_ticks = 0;
  std::uint32_t jitter_ticks = 0;
  std::uint32_t first_tick = 0;
  std::uint32_t end_tick = 0xffffffffu;
};

// Keeps the order: nothing overtakes, so what comes after a long delay comes at once with what was behind it.
// Ticks never decrease. One thread.
class DelayLine {
 public:
  DelayLine() : DelayLine({}, 0) {}
  DelayLine(std::vector<Delay> delays, std::uint32_t seed) : delays_(std::move(delays)), random_(seed) {}

  void submit(std::vector<std::uint8_t> bytes, std::uint32_t tick) {
    if (bytes.empty()) return;
    std::uint32_t due = tick;
    for (const Delay& delay : delays_) {
      if (tick < delay.first_tick || tick >= delay.end_tick) continue;
      due += delay.delay_ticks + static_cast<std::uint32_t>(random_() % (delay.jitter_ticks + 1u));
    }
    last_due_ = std::max(last_due_, due);
    if (last_due_ > tick) ++delayed_;
    waiting_.emplace_back(last_due_, std::move(bytes));
  }

  // What is due by now, one submission after the other.
  template <class Take>
  void deliver(std::uint32_t tick, Take take) {
    for (; !waiting_.empty() && waiting_.front().first <= tick; waiting_.pop_front())
      take(waiting_.front().second);
  }
  // Submissions that did not pass at once.
  [[nodiscard]] std::uint64_t delayed() const { return delayed_; }

 private:
  std::vector<Delay> delays_;
  std::mt19937 random_;
  std::uint32_t last_due_ = 0;
  std::uint64_t delayed_ = 0;
  std::deque<std::pair<std::uint32_t, std::vector<std::uint8_t>>> waiting_;
};

}  // namespace palpate::link
