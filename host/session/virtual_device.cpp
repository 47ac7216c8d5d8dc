#include "host/session/virtual_device.hpp"

#include <chrono>
#include <exception>
#include <span>
#include <stdexcept>
#include <utility>

#include "shared/servo_tick.hpp"

namespace palpate::host {

VirtualDevice::VirtualDevice(const plant::PlantParameters& parameters, plant::TipPath path,
                             std::unique_ptr<LockstepPeer> board, std::unique_ptr<link::Transport> link)
    : path_(std::move(path)),
      reach_(parameters.arm),
      board_(std::move(board)),
      link_(std::move(link)),
      plant_(parameters, path_),
      guide_({}, path_.at(0.0).position_m),
      device_(plant_, *board_) {
  plant_.guide(guide_.now());  // refuses another kind of hand now
}

VirtualDevice::~VirtualDevice() {
  stop();
}

void VirtualDevice::start() {
  if (thread_.joinable() || stop_) throw std::logic_error("virtual device: it has been started already");
  state_.running = true;
  try {
    thread_ = std::thread([this] { run(); });
  } catch (...) {
    state_.running = false;
    throw;
  }
}

void VirtualDevice::stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void VirtualDevice::run() {
  std::string error;
  try {
    pacer_.begin(device_.tick());
    while (!stop_)
      if (pacer_.wait_for(device_.tick())) run_tick();
    device_.shut_down();
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  const std::lock_guard lock(mutex_);
  state_.running = false;
  state_.error = std::move(error);
}

void VirtualDevice::run_tick() {
  std::vector<std::function<void()>> controls;
  {
    const std::lock_guard lock(mutex_);
    controls.swap(controls_);
  }
  for (const auto& control : controls) control();
  if (path_began_s_ < 0.0) {
    plant_.guide(guide_.advance(kTick_s));
  } else {
    const plant::PathPoint point = path_.at(plant_.time_s() - path_began_s_);
    guide_.jump_to(point.position_m);
    plant_.guide(point);
  }

  device_.receive(link_->read(std::chrono::microseconds(0)));
  lockstep::SensorFrame sensors = device_.sensors();
  if (emergency_stop_) sensors.flags |= lockstep::kEmergencyStop;
  lockstep::ActuatorFrame actuators{};
  device_.run(sensors, actuators);
  // What no program reads is lost, as on a real line.
  if (actuators.link_length != 0) (void)link_->write(std::span(actuators.link).first(actuators.link_length));

  const std::lock_guard lock(mutex_);
  state_.tick = device_.tick();
  state_.tip_m = plant_.tip_position_m();
  state_.hand_force_N = plant_.hand_force_N();
  state_.force_N = actuators.force_N;
  state_.mode = actuators.mode;
  state_.faults = actuators.faults;
  state_.outputs_on = actuators.enabled != 0;
  state_.slipped_s = pacer_.slipped_s();
  state_.link = link_->counters();
}

bool VirtualDevice::guide_hand(const Vec3d& target_m) {
  try {
    (void)reach_.joint_angles_rad(target_m, "target of the hand");
  } catch (const std::invalid_argument&) {
    return false;
  }
  const std::lock_guard lock(mutex_);
  controls_.emplace_back([this, target_m] {
    path_began_s_ = -1.0;
    guide_.set_target(target_m);
  });
  return true;
}

void VirtualDevice::play_path() {
  const std::lock_guard lock(mutex_);
  controls_.emplace_back([this] { path_began_s_ = plant_.time_s(); });
}

VirtualDeviceState VirtualDevice::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

}  // namespace palpate::host
