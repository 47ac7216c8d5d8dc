#include "host/session/emulated_device.hpp"

#include <algorithm>

#include "shared/servo_tick.hpp"

namespace palpate::host {

lockstep::SensorFrame EmulatedDevice::sensors() {
  lockstep::SensorFrame sensors{};
  sensors.magic = lockstep::kSensorMagic;
  sensors.tick = tick_ - board_began_tick_;
  sensors.encoder_count = plant_.encoder_counts();
  sensors.current_A = plant_.measured_current_A();
  const std::size_t length = std::min(to_board_.size(), sensors.link.size());
  sensors.link_length = static_cast<std::uint32_t>(length);
  const auto end_of_tick = to_board_.begin() + static_cast<std::ptrdiff_t>(length);
  std::copy(to_board_.begin(), end_of_tick, sensors.link.begin());
  to_board_.erase(to_board_.begin(), end_of_tick);
  return sensors;
}

void EmulatedDevice::run(const lockstep::SensorFrame& sensors, lockstep::ActuatorFrame& actuators) {
  board_.send(sensors);
  if ((sensors.flags & lockstep::kReset) != 0) {
    to_board_.clear();
    board_began_tick_ = tick_;
    lockstep::SensorFrame first = sensors;
    first.tick = 0;
    first.flags &= ~static_cast<std::uint32_t>(lockstep::kReset);
    first.link_length = 0;
    board_.send(first);
  }
  board_.receive(actuators);
  actuators.tick += board_began_tick_;
  actuators.next_tick += board_began_tick_;
  require_of_board(actuators.magic == lockstep::kActuatorMagic && actuators.tick == tick_ &&
                       actuators.link_length <= actuators.link.size(),
                   "its actuator frame has a wrong magic number, tick or length");
  require_of_board(actuators.next_tick > tick_, "its next tick is not after the present one");
  const std::uint32_t elapsed = actuators.next_tick - tick_;  // more than 1 where deadlines were missed
  plant_.advance(actuators.setpoint_A, actuators.enabled != 0, elapsed * kTick_s);
  tick_ += elapsed;
}

void EmulatedDevice::shut_down() {
  lockstep::SensorFrame last{};
  last.magic = lockstep::kSensorMagic;
  last.tick = tick_ - board_began_tick_;
  last.flags = lockstep::kShutdown;
  last.encoder_count = plant_.encoder_counts();
  board_.send(last);
  lockstep::ActuatorFrame farewell{};
  board_.receive(farewell);
}

}  // namespace palpate::host
