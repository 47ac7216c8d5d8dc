// What tick it is on a board that runs by itself, by what it says and when that came.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

namespace palpate::host {

// Messages come late by what the link takes, never early: the offset of the board's clock to the host's is
// the largest one seen, but for the drift of two quartzes. One thread.
class BoardClock {
 public:
  // Two quartzes drift apart by some 1e-4; ten times that, so that a delay that has gone is forgotten, too.
  static constexpr double kDrift = 1e-3;
  // A board that is this far from where it should be has started again.
  static constexpr double kRestart_ticks = 2000.0;

  // The board has said something of this tick; `now_s` is the host's clock. True: it has started again since
  // it was heard last.
  bool hear(std::uint32_t tick, double now_s) {
    const double heard = known_ ? unwrapped(tick) : static_cast<double>(tick);
    const double offset = heard - now_s * kTicks_1_s;
    const double expected = offset_ - kDrift * kTicks_1_s * (now_s - heard_s_);
    const bool again = !known_ || offset < expected - kRestart_ticks || offset > expected + kRestart_ticks;
    offset_ = again ? offset : std::max(offset, expected);
    newest_ = again ? heard : std::max(newest_, heard);
    heard_s_ = now_s;
    return std::exchange(known_, true) && again;
  }

  // Before anything was heard the host's own milliseconds.
  [[nodiscard]] std::uint32_t tick(double now_s) const {
    const double ticks = now_s * kTicks_1_s + offset_;
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(ticks));
  }

 private:
  static constexpr double kTicks_1_s = 1000.0;

  // The board's counter is modulo 2^32: the number nearest to the newest one.
  [[nodiscard]] double unwrapped(std::uint32_t tick) const {
    const auto newest = static_cast<std::uint32_t>(static_cast<std::int64_t>(newest_));
    return newest_ + static_cast<double>(static_cast<std::int32_t>(tick - newest));
  }

  bool known_ = false;
  double offset_ = 0.0;  // ticks
  double newest_ = 0.0;  // tick heard of, not wrapped
  double heard_s_ = 0.0;
};

}  // namespace palpate::host
