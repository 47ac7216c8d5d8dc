#pragma once

#include <atomic>
#include <cstdint>

#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32/watchdog.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::stm32 {

// A background that has not come round for so long is stuck: the longest that it takes when it works, models
// with bases decoded at once, is a few ticks.
inline constexpr std::uint32_t kBackgroundPatience_ticks = 50;
// Ticks after which a start has succeeded.
inline constexpr std::uint32_t kStarted_ticks = 1000;

// Refreshes the watchdog from ticks that have ended in time, while the background comes round.
class TickGuard {
 public:
  // Interrupt context.
  void isr_begin_tick(std::uint32_t tick) { tick_.store(tick, std::memory_order_relaxed); }
  void isr_end_tick(const firmware::TickReport& report) {
    const bool in_time = report.missed_deadlines == missed_deadlines_;
    missed_deadlines_ = report.missed_deadlines;
    const std::uint32_t silent_ticks = report.tick - background_tick_.load(std::memory_order_relaxed);
    if (silent_ticks > kBackgroundPatience_ticks) {
      record_fault(FaultReason::background_stuck, report.tick);
    } else if (in_time) {
      refresh_watchdog();
    }
    if (report.tick == kStarted_ticks) note_started();
  }
  // Background: it has come round.
  void note_background() {
    background_tick_.store(tick_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  }

 private:
  std::uint32_t missed_deadlines_ = 0;             // interrupt's own
  std::atomic<std::uint32_t> tick_{0};             // written by the interrupt
  std::atomic<std::uint32_t> background_tick_{0};  // written by the background
};

}  // namespace palpate::stm32
