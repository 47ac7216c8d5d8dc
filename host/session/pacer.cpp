#include "host/session/pacer.hpp"

#include <thread>

#include "shared/servo_tick.hpp"

namespace palpate::host {

void Pacer::begin(std::uint32_t tick, double speed) {
  began_ = Clock::now();
  began_tick_ = tick;
  speed_ = speed;
}

std::optional<double> Pacer::wait_for(std::uint32_t tick) {
  const std::chrono::duration<double> should(static_cast<double>(tick - began_tick_) * kTick_s / speed_);
  const auto due = began_ + std::chrono::duration_cast<Clock::duration>(should);
  if (due - Clock::now() > kPause) {
    std::this_thread::sleep_for(kPause);
    return std::nullopt;
  }
  std::this_thread::sleep_until(due);
  const double late_s = std::chrono::duration<double>(Clock::now() - due).count();
  if (late_s > kMostBehind_s) {
    begin(tick, speed_);
    slipped_s_ += late_s;
  }
  return late_s;
}

}  // namespace palpate::host
