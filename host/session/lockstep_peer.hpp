// The board's end of the lock-step exchange, as the closed loop sees it.
#pragma once

#include <stdexcept>
#include <string>

#include "boards/lockstep/exchange.hpp"

namespace palpate::host {

// Throws std::runtime_error that says so of the board.
inline void require_of_board(bool good, const char* what) {
  if (!good) throw std::runtime_error(std::string("board: ") + what);
}

// A board at the other end of two byte streams (boards/lockstep/exchange.hpp).
class LockstepPeer {
 public:
  virtual ~LockstepPeer() = default;
  // Throws std::runtime_error when the board is gone or speaks another protocol.
  virtual void send(const lockstep::SensorFrame& frame) = 0;
  virtual void receive(lockstep::ActuatorFrame& frame) = 0;
};

// Over two blocking file descriptors, which stay the caller's.
class FileDescriptorPeer final : public LockstepPeer {
 public:
  FileDescriptorPeer(int actuator_fd, int sensor_fd) : actuator_fd_(actuator_fd), sensor_fd_(sensor_fd) {}
  void send(const lockstep::SensorFrame& frame) override;
  void receive(lockstep::ActuatorFrame& frame) override;

 private:
  int actuator_fd_, sensor_fd_;
};

}  // namespace palpate::host
