#include "host/session/closed_loop.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <utility>

#include "shared/servo_tick.hpp"

namespace palpate::host {
namespace {

constexpr std::size_t kTicksPerReport = 10;

bool contains(const std::vector<std::uint32_t>& ticks, std::uint32_t tick) {
  return std::find(ticks.begin(), ticks.end(), tick) != ticks.end();
}

}  // namespace

ClosedLoop::ClosedLoop(const Body& body, const BodyState& start, plant::Plant& plant, LockstepPeer& board,
                       link::Medium& down, link::Medium& up, const ClosedLoopConfig& config)
    : plant_(plant),
      board_(board),
      down_(down),
      up_(up),
      config_(config),
      host_(body, start, config),
      faults_down_(config.faults_down),
      faults_up_(config.faults_up) {}

// What the board reads in this tick.
lockstep::SensorFrame ClosedLoop::sensors() {
  lockstep::SensorFrame sensors{};
  sensors.magic = lockstep::kSensorMagic;
  sensors.tick = tick_;
  sensors.encoder_count = plant_.encoder_counts();
  sensors.current_A = plant_.measured_current_A();
  if (emergency_stop_ || contains(config_.emergency_stop_ticks, tick_))
    sensors.flags |= lockstep::kEmergencyStop;
  if (burn_ || contains(config_.overlong_ticks, tick_)) sensors.flags |= lockstep::kBurnCycles;
  burn_ = false;
  // After lost ticks more has arrived than the exchange holds: the rest waits for the ticks to come.
  const std::vector<std::uint8_t> arrived = down_.deliver(tick_);
  to_board_.insert(to_board_.end(), arrived.begin(), arrived.end());
  const std::size_t length = std::min(to_board_.size(), sensors.link.size());
  sensors.link_length = static_cast<std::uint32_t>(length);
  const auto end_of_tick = to_board_.begin() + static_cast<std::ptrdiff_t>(length);
  std::copy(to_board_.begin(), end_of_tick, sensors.link.begin());
  to_board_.erase(to_board_.begin(), end_of_tick);
  return sensors;
}

LoopTick ClosedLoop::advance() {
  for (; next_grip_ < config_.grip_changes.size() && config_.grip_changes[next_grip_].tick <= tick_;
       ++next_grip_)
    plant_.set_grip(config_.grip_changes[next_grip_].grip);

  const lockstep::SensorFrame read = sensors();
  LoopTick row;
  row.tick = tick_;
  row.encoder_count = read.encoder_count;
  row.measured_current_A = read.current_A;
  row.true_tip_m = plant_.tip_position_m();
  row.hand_target_m = plant_.intended_position_m();
  row.hand_force_N = plant_.hand_force_N();

  board_.send(read);
  board_.receive(row.board);
  require_of_board(row.board.magic == lockstep::kActuatorMagic && row.board.tick == tick_ &&
                       row.board.link_length <= row.board.link.size(),
                   "its actuator frame has a wrong magic number, tick or length");
  require_of_board(row.board.next_tick > tick_, "its next tick is not after the present one");
  const std::uint32_t elapsed = row.board.next_tick - tick_;  // more than 1 where deadlines were missed

  const std::vector<std::uint8_t> from_board =
      faults_up_.apply(std::span(row.board.link).first(row.board.link_length));
  if (!unplugged_) (void)up_.submit(from_board, tick_);
  plant_.advance(row.board.setpoint_A, row.board.enabled != 0, elapsed * kTick_s);
  tick_ += elapsed;

  const std::vector<std::uint8_t> to_host = up_.deliver(tick_);
  row.link_up_bytes = static_cast<std::uint32_t>(to_host.size());
  row.link_down_bytes = read.link_length;
  host_.receive(to_host, tick_);
  for (const link::OutgoingFrame& frame :
       host_.poll(tick_, down_.backlog_bytes(tick_), down_.bytes_per_tick()))
    if (const std::vector<std::uint8_t> bytes = faults_down_.apply(frame.bytes); !unplugged_)
      (void)down_.submit(bytes, tick_);
  return row;
}

void ClosedLoop::add_fault(bool to_board, const link::Fault& fault) {
  (void)(to_board ? faults_down_ : faults_up_).add(fault);
}

void ClosedLoop::shut_down() {
  lockstep::SensorFrame last{};
  last.magic = lockstep::kSensorMagic;
  last.tick = tick_;
  last.flags = lockstep::kShutdown;
  last.encoder_count = plant_.encoder_counts();
  board_.send(last);
  lockstep::ActuatorFrame farewell{};
  board_.receive(farewell);
}

ClosedLoopResult run_closed_loop(const Body& body, const BodyState& start, plant::Plant& plant,
                                 LockstepPeer& board, link::Medium& down, link::Medium& up,
                                 const ClosedLoopConfig& config, const Progress& progress) {
  ClosedLoop loop(body, start, plant, board, down, up, config);
  std::vector<LoopTick> recorded;
  recorded.reserve(config.ticks);
  while (loop.tick() < config.ticks) {
    recorded.push_back(loop.advance());
    if (recorded.size() % kTicksPerReport == 0 && progress &&
        !progress(std::min(loop.tick(), config.ticks), config.ticks))
      throw std::runtime_error("stopped");
  }
  loop.shut_down();
  return loop.host().finish(std::move(recorded));
}

}  // namespace palpate::host
