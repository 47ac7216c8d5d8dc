#include "host/session/closed_loop.hpp"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "host/session/board_clock.hpp"

namespace palpate::host {
namespace {

constexpr std::size_t kTicksPerReport = 10;

bool contains(const std::vector<std::uint32_t>& ticks, std::uint32_t tick) {
  return std::find(ticks.begin(), ticks.end(), tick) != ticks.end();
}

}  // namespace

ClosedLoop::ClosedLoop(const Body& body, const BodyState& start, plant::Plant& plant, LockstepPeer& board,
                       link::Medium& down, link::Medium& up, const ClosedLoopConfig& config,
                       link::UsbHost* usb)
    : plant_(plant),
      device_(plant, board),
      down_(down),
      usb_(usb),
      config_(config),
      host_(body, start, config),
      link_(down, up, config, usb) {
  host_.listen_to_ticks([this](std::uint32_t first, std::uint32_t count, std::uint32_t now) {
    hear_of_ticks(first, count, now);
  });
}

// What was asked for again is older than the newest tick by a tip history at most.
void ClosedLoop::hear_of_ticks(std::uint32_t first, std::uint32_t count, std::uint32_t now) {
  const std::uint32_t newest = first + count - 1;
  if (static_cast<double>(newest) + BoardClock::kRestart_ticks < static_cast<double>(newest_tick_)) {
    ++board_restarts_;
    board_began_tick_ = tick() - newest;
    newest_tick_ = newest;
    host_.begin_anew();
    return;
  }
  newest_tick_ = std::max(newest_tick_, newest);
  if (listener_ && board_restarts_ == 0) listener_(first, count, now);
}

// What the board reads in this tick.
lockstep::SensorFrame ClosedLoop::sensors() {
  device_.receive(link_.to_board(tick()));
  lockstep::SensorFrame sensors = device_.sensors();
  if (emergency_stop_ || contains(config_.emergency_stop_ticks, tick()))
    sensors.flags |= lockstep::kEmergencyStop;
  if (contains(config_.supply_low_ticks, tick())) sensors.flags |= lockstep::kSupplyLow;
  if (burn_ || contains(config_.overlong_ticks, tick())) sensors.flags |= lockstep::kBurnCycles;
  if (contains(config_.reset_ticks, tick())) sensors.flags |= lockstep::kReset;
  for (const EncoderSlip& slip : config_.encoder_slips)
    if (slip.tick <= tick()) sensors.encoder_count.at(slip.joint) += slip.count;
  burn_ = false;
  return sensors;
}

LoopTick ClosedLoop::advance() {
  for (; next_grip_ < config_.grip_changes.size() && config_.grip_changes[next_grip_].tick <= tick();
       ++next_grip_)
    plant_.set_grip(config_.grip_changes[next_grip_].grip);

  const lockstep::SensorFrame read = sensors();
  LoopTick row;
  row.tick = tick();
  row.encoder_count = read.encoder_count;
  row.measured_current_A = read.current_A;
  row.true_tip_m = plant_.tip_position_m();
  row.hand_target_m = plant_.intended_position_m();
  row.hand_force_N = plant_.hand_force_N();

  const std::uint32_t now = tick();
  device_.run(read, row.board);

  // On USB the exchange carries the bus; what has crossed is what the board has acknowledged.
  const std::uint64_t arrived = down_.counters().bytes_delivered;
  link_.send_up(std::span(row.board.link).first(row.board.link_length), now);
  row.link_down_bytes = usb_ == nullptr
                            ? read.link_length
                            : static_cast<std::uint32_t>(down_.counters().bytes_delivered - arrived);

  const std::vector<std::uint8_t> to_host = link_.to_host(tick());
  row.link_up_bytes = static_cast<std::uint32_t>(to_host.size());
  if (link_.host_runs(tick())) {
    host_.receive(to_host, host_tick());
    for (const link::OutgoingFrame& frame :
         host_.poll(host_tick(), down_.backlog_bytes(tick()), down_.bytes_per_tick()))
      link_.send_down(frame.bytes, tick());
  }
  link_.send_of_others(tick());
  return row;
}

ClosedLoopResult run_closed_loop(const Body& body, const BodyState& start, plant::Plant& plant,
                                 LockstepPeer& board, link::Medium& down, link::Medium& up,
                                 const ClosedLoopConfig& config, const Progress& progress,
                                 link::UsbHost* usb) {
  ClosedLoop loop(body, start, plant, board, down, up, config, usb);
  std::vector<LoopTick> recorded;
  recorded.reserve(config.ticks);
  std::vector<std::uint32_t> heard(config.ticks, ClosedLoopResult::kNeverHeard);
  loop.listen_to_ticks([&heard](std::uint32_t first, std::uint32_t count, std::uint32_t now) {
    for (std::uint32_t tick = first; tick - first < count && tick < heard.size(); ++tick)
      heard[tick] = std::min(heard[tick], now);
  });
  while (loop.tick() < config.ticks) {
    recorded.push_back(loop.advance());
    if (recorded.size() % kTicksPerReport == 0 && progress &&
        !progress(std::min(loop.tick(), config.ticks), config.ticks))
      throw std::runtime_error("stopped");
  }
  loop.shut_down();
  ClosedLoopResult result = loop.host().finish(std::move(recorded));
  for (const LoopTick& row : result.ticks)
    result.heard_ticks.push_back(row.tick < heard.size() ? heard[row.tick] : ClosedLoopResult::kNeverHeard);
  result.down = down.counters();
  result.up = up.counters();
  result.troubles = loop.troubles();
  result.hit_ticks_down = loop.hit_ticks(true);
  result.hit_ticks_up = loop.hit_ticks(false);
  // On USB the board alone knows what nobody took from it.
  if (usb != nullptr) result.troubles.frames_removed_up += loop.host().frames_unsent();
  result.counters.board_restarts = loop.board_restarts();
  return result;
}

}  // namespace palpate::host
