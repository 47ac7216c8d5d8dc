// A board in lock-step with the plant that it drives: a device with a person's hand on it, but for the link.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>

#include "boards/lockstep/exchange.hpp"
#include "host/plant/plant.hpp"
#include "host/session/lockstep_peer.hpp"

namespace palpate::host {

// What it is given must outlive it. One thread.
class EmulatedDevice {
 public:
  EmulatedDevice(plant::Plant& plant, LockstepPeer& board) : plant_(plant), board_(board) {}

  // The next servo tick.
  [[nodiscard]] std::uint32_t tick() const { return tick_; }

  // Bytes that have arrived at the board's end of the link: it reads them from the next tick on, as many in
  // each as the exchange holds.
  void receive(std::span<const std::uint8_t> bytes) {
    to_board_.insert(to_board_.end(), bytes.begin(), bytes.end());
  }

  // What the board will read in the next tick.
  [[nodiscard]] lockstep::SensorFrame sensors();
  // Runs the next tick with these sensors, and lets the plant go on until the one after: `actuators` says by
  // how many ticks, and its ticks are those of the run, whenever the board has begun to count its own.
  // With kReset the board starts again in this tick: what it has not read of the link is lost. Throws what
  // plant and peer throw, std::runtime_error where the board's answer is none.
  void run(const lockstep::SensorFrame& sensors, lockstep::ActuatorFrame& actuators);
  // Tells the board to end.
  void shut_down();

 private:
  plant::Plant& plant_;
  LockstepPeer& board_;
  std::deque<std::uint8_t> to_board_;  // arrived, and not in the exchange yet
  std::uint32_t tick_ = 0;
  std::uint32_t board_began_tick_ = 0;  // its tick 0
};

}  // namespace palpate::host
