#include "host/session/live_loop.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <utility>

#include "host/plant/check.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kAtPath_m = 1e-4;  // the hand is there, and the path begins

ClosedLoopConfig without_script(ClosedLoopConfig config) {
  config.grip_changes.clear();
  config.probe_node.reset();
  return config;
}

}  // namespace

LiveLoop::LiveLoop(LiveSetup setup)
    : body_(std::move(setup.body)),
      path_(std::move(setup.path)),
      reach_(setup.plant.arm),
      board_(std::move(setup.board)),
      link_(std::move(setup.link)),
      plant_(setup.plant, path_),
      guide_(setup.guide, path_.at(0.0).position_m),
      is_can_(setup.loop.framing != link::FramingKind::serial),
      most_busy_ticks_(static_cast<std::uint32_t>(std::ceil(1.0 / (setup.loop.session.update_Hz * kTick_s)))),
      loop_(body_, setup.start, plant_, *board_, link_->down(), link_->up(),
            without_script(std::move(setup.loop)), link_->usb_host()) {
  plant_.guide(guide_.now());  // refuses another kind of hand now
}

LiveLoop::~LiveLoop() {
  stop();
}

void LiveLoop::start() {
  if (thread_.joinable() || stop_) throw std::logic_error("live loop: it has been started already");
  feed_.edit([](LiveStatus& status) { status.running = true; });
  try {
    thread_ = std::thread([this] { run(); });
  } catch (...) {
    feed_.edit([](LiveStatus& status) { status.running = false; });
    throw;
  }
}

void LiveLoop::stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void LiveLoop::run() {
  std::string error;
  try {
    pacer_.begin(loop_.tick());
    while (!stop_) {
      std::vector<std::function<void()>> controls;
      {
        const std::lock_guard lock(mutex_);
        controls.swap(controls_);
      }
      const double speed_before = speed_;
      for (const auto& control : controls) control();
      if (speed_ <= 0.0) {
        std::this_thread::sleep_for(Pacer::kPause);
        pacer_.begin(loop_.tick());
        continue;
      }
      if (speed_ != speed_before) pacer_.begin(loop_.tick(), speed_);

      // A body that takes longer than its time slows everything down: otherwise it would fall behind for
      // ever.
      if (loop_.host().busy_ticks(loop_.tick()) >= most_busy_ticks_ &&
          !loop_.host().wait_until_computed(Pacer::kPause))
        continue;

      const std::optional<double> late_s = pacer_.wait_for(loop_.tick());
      if (!late_s) continue;
      const auto now = Clock::now();
      LiveTick tick;
      tick.late_s = static_cast<float>(*late_s);
      plant_.guide(intended());
      tick.loop = loop_.advance();
      tick.took_s = std::chrono::duration<float>(Clock::now() - now).count();
      feed_.add(tick);
      feed_.look_at(loop_.host(), loop_.tick());
      feed_.edit([this](LiveStatus& status) {
        status.slipped_s = pacer_.slipped_s();
        status.down = link_->down().counters();
        status.up = link_->up().counters();
        status.troubles = loop_.troubles();
      });
    }
    loop_.shut_down();
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  {
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
    controls_.clear();
  }
  feed_.edit([&error](LiveStatus& status) {
    status.running = false;
    status.error = std::move(error);
  });
}

plant::PathPoint LiveLoop::intended() {
  if (path_began_s_) {
    const plant::PathPoint point = path_.at(plant_.time_s() - *path_began_s_);
    guide_.jump_to(point.position_m);
    return point;
  }
  const plant::PathPoint point = guide_.advance(kTick_s);
  if (going_to_path_ && norm(point.position_m - path_.at(0.0).position_m) < kAtPath_m) {
    going_to_path_ = false;
    path_began_s_ = plant_.time_s();
  }
  return point;
}

void LiveLoop::post(std::function<void()> control) {
  const std::lock_guard lock(mutex_);
  if (!has_ended_) controls_.push_back(std::move(control));
}

bool LiveLoop::guide_hand(const Vec3d& target_m) {
  try {
    (void)reach_.joint_angles_rad(target_m, "target of the hand");
  } catch (const std::invalid_argument&) {
    return false;
  }
  post([this, target_m] {
    path_began_s_.reset();
    going_to_path_ = false;
    guide_.set_target(target_m);
  });
  return true;
}

void LiveLoop::play_path() {
  post([this] {
    path_began_s_.reset();
    going_to_path_ = true;
    guide_.set_target(path_.at(0.0).position_m);
  });
}

void LiveLoop::set_grip(double grip) {
  plant::require_range("grip", grip, 0.0, 1.0);
  post([this, grip] { plant_.set_grip(grip); });
}

void LiveLoop::arm() {
  post([this] { loop_.host().arm(); });
}

void LiveLoop::command(firmware::Action action) {
  post([this, action] { loop_.host().command(action); });
}

void LiveLoop::set_emergency_stop(bool open) {
  post([this, open] {
    if (open) loop_.host().cancel_arming();
    loop_.set_emergency_stop(open);
  });
}

void LiveLoop::set_unplugged(bool unplugged) {
  post([this, unplugged] {
    if (unplugged) loop_.host().cancel_arming();
    loop_.set_unplugged(unplugged);
  });
}

void LiveLoop::set_babbling(bool babbling) {
  if (is_can_) post([this, babbling] { loop_.set_babbling(babbling); });
}

void LiveLoop::burn_next_tick() {
  post([this] { loop_.burn_next_tick(); });
}

void LiveLoop::add_faults(bool to_board, link::FaultKind kind, std::size_t argument, std::uint32_t count) {
  plant::require_range("number of frames with faults", count, 1.0, 1000.0);
  if (kind == link::FaultKind::reorder)
    plant::require_range("frames that come before", static_cast<double>(argument), 1.0, 1000.0);
  if (is_can_ && (kind == link::FaultKind::truncate || kind == link::FaultKind::reorder))
    throw std::invalid_argument(
        "faults on CAN: no frame is cut short, for its length is under its CRC, and those of one identifier "
        "keep their order");
  post([=, this] {
    for (std::uint64_t frame = 0; frame < count; ++frame) loop_.add_fault(to_board, {frame, kind, argument});
  });
}

void LiveLoop::set_host_delay(std::uint32_t ticks) {
  plant::require_range("host delay in ticks", ticks, 0.0, 1000.0);
  post([this, ticks] { loop_.host().set_delay(ticks); });
}

void LiveLoop::set_speed(double speed) {
  if (speed != 0.0) plant::require_range("speed", speed, kSlowest, 10.0);
  post([this, speed] { speed_ = speed; });
}

}  // namespace palpate::host
