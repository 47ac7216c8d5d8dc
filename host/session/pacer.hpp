// Keeps a loop in virtual time beside the wall clock.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace palpate::host {

// One thread.
class Pacer {
 public:
  // Longest delay that is made up for afterwards: more would be seen as the loop running ahead in a hurry.
  static constexpr double kMostBehind_s = 0.05;
  // At most that long a wait, so that whoever runs the loop can look around in between.
  static constexpr std::chrono::milliseconds kPause{5};

  // Tick `tick` is due now; those after it each kTick_s / speed later. speed > 0.
  void begin(std::uint32_t tick, double speed = 1.0);

  // Waits until the tick is due, at most kPause. Returns by how many seconds it is late, nothing where it is
  // not due yet. Later than kMostBehind_s, it counts as due now, and the wall clock has gone on without the
  // loop (slipped_s).
  std::optional<double> wait_for(std::uint32_t tick);
  [[nodiscard]] double slipped_s() const { return slipped_s_; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point began_ = Clock::now();
  std::uint32_t began_tick_ = 0;
  double speed_ = 1.0;
  double slipped_s_ = 0.0;
};

}  // namespace palpate::host
