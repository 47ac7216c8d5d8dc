// Keeps the tick number equal to time in milliseconds, and counts what came late.
#pragma once

#include <cstdint>

namespace palpate::firmware {

// Interrupt context. Counts are those of a clock that runs upwards, wraps, and is in step with the servo
// timer.
//
// A tick that has not ended when the next one is due has missed a deadline; it has missed one for each that
// passes. The timer remembers a single interrupt, so the ticks between are lost: their numbers are skipped.
class DeadlineMonitor {
 public:
  // count_per_tick 0: no clock, no deadlines. Tick 0 is due at first_due_count, known to within a tenth of a
  // tick and never too late.
  void isr_start(std::uint32_t count_per_tick, std::uint32_t first_due_count) {
    count_per_tick_ = count_per_tick;
    due_count_ = first_due_count;
  }

  // First thing in the interrupt. False: the interrupt belongs to a tick that has been counted as lost
  // already, and there is nothing to do.
  bool isr_begin(std::uint32_t now_count) {
    const std::uint32_t skipped = next_tick_ - tick_;
    const std::uint32_t due_count = due_count_ + skipped * count_per_tick_;
    // Not "before due": the first due count may be a little off.
    if (static_cast<std::int32_t>(now_count - due_count) < -static_cast<std::int32_t>(count_per_tick_ / 2))
      return false;
    elapsed_ticks_ = skipped != 0 ? skipped : 1;
    tick_ = next_tick_;
    due_count_ = due_count;
    begin_count_ = now_count;
    return true;
  }

  // When all is computed: how many deadlines this tick has missed. Fixes the number of the next tick.
  std::uint32_t isr_check(std::uint32_t now_count) {
    const std::uint32_t passed_at_begin = ticks_since_due(begin_count_);
    const std::uint32_t passed = ticks_since_due(now_count);
    // What became due while this tick ran is pending, and will run at once as the newest of them. Otherwise
    // the next interrupt is that of the next due time.
    next_tick_ = tick_ + (passed > passed_at_begin ? passed : passed + 1);
    missed_deadlines_ += passed;
    return passed;
  }

  // Last thing in the interrupt.
  void isr_end(std::uint32_t now_count) {
    tick_count_ = now_count - begin_count_;
    if (tick_count_ > worst_tick_count_) worst_tick_count_ = tick_count_;
  }

  [[nodiscard]] std::uint32_t tick() const { return tick_; }
  [[nodiscard]] std::uint32_t next_tick() const { return next_tick_; }  // after isr_check()
  [[nodiscard]] std::uint32_t elapsed_ticks() const {
    return elapsed_ticks_;
  }  // since the tick before; 1: none was lost
  [[nodiscard]] std::uint32_t missed_deadlines() const { return missed_deadlines_; }  // so far
  [[nodiscard]] std::uint32_t tick_count() const { return tick_count_; }  // length of the last tick
  [[nodiscard]] std::uint32_t worst_tick_count() const { return worst_tick_count_; }

 private:
  [[nodiscard]] std::uint32_t ticks_since_due(std::uint32_t now_count) const {
    if (count_per_tick_ == 0) return 0;
    const auto late_count = static_cast<std::int32_t>(now_count - due_count_);
    return late_count > 0 ? static_cast<std::uint32_t>(late_count) / count_per_tick_ : 0;
  }

  std::uint32_t count_per_tick_ = 0;
  std::uint32_t tick_ = 0;
  std::uint32_t next_tick_ = 0;
  std::uint32_t elapsed_ticks_ = 1;
  std::uint32_t due_count_ = 0;  // of tick_
  std::uint32_t begin_count_ = 0;
  std::uint32_t tick_count_ = 0;
  std::uint32_t worst_tick_count_ = 0;
  std::uint32_t missed_deadlines_ = 0;
};

}  // namespace palpate::firmware
