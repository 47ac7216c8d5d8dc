#include "host/session/attached_loop.hpp"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include "host/link/known_boards.hpp"
#include "host/plant/check.hpp"

namespace palpate::host {
namespace {

ClosedLoopConfig for_a_board(ClosedLoopConfig config, const link::Transport& link) {
  config.framing = link.framing();
  config.arms_by_itself = false;
  if (config.known_boards.empty())
    config.known_boards.assign(link::known_boards().begin(), link::known_boards().end());
  config.session_beside = true;
  config.first_transfer_id = link::fresh_transfer_id();
  config.trace.form = TraceForm::full;  // what the screen shows
  config.grip_changes.clear();
  config.probe_node.reset();
  return config;
}

constexpr double kTicksPerS = 1000.0;

bool is_armed(const std::optional<palpate_BoardStatus_1_0>& status) {
  return status && (status->mode == palpate_BoardStatus_1_0_MODE_RENDER ||
                    status->mode == palpate_BoardStatus_1_0_MODE_SUSPENDED);
}
// Where the link's rate is not known: USB full speed and UDP bring about a megabyte a second.
constexpr double kUnknownBytesPerTick = 1000.0;

}  // namespace

AttachedLoop::AttachedLoop(AttachedSetup setup)
    : body_(std::move(setup.body)),
      address_(std::move(setup.address)),
      arm_(setup.plant.arm),
      encoder_reference_(setup.plant.encoder_reference),
      link_(link::open_transport(address_)),
      host_(body_, setup.start, for_a_board(std::move(setup.loop), *link_)) {
  host_.listen([this](const palpate_ServoTrace_1_0& trace) { take(trace); });
}

AttachedLoop::~AttachedLoop() {
  stop();
}

void AttachedLoop::start() {
  if (thread_.joinable() || stop_) throw std::logic_error("attached loop: it has been started already");
  feed_.edit([](LiveStatus& status) {
    status.running = true;
    status.links_opened = 1;
  });
  try {
    thread_ = std::thread([this] { run(); });
  } catch (...) {
    feed_.edit([](LiveStatus& status) { status.running = false; });
    throw;
  }
}

void AttachedLoop::stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

double AttachedLoop::now_s() const {
  return std::chrono::duration<double>(Clock::now() - began_).count();
}

void AttachedLoop::run() {
  std::string error;
  try {
    while (!stop_) run_once();
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  try {
    leave();
  } catch (const std::exception& problem) {
    if (error.empty()) error = problem.what();
  }
  feed_.edit([&error](LiveStatus& status) {
    status.running = false;
    status.error = std::move(error);
  });
}

void AttachedLoop::leave() {
  const auto latest = Clock::now() + kLeavePatience;
  while (armed_ && link_->is_open() && Clock::now() < latest) {
    (void)link_->write(host_.disarm().bytes);
    host_.receive(link_->read(kLeaveAgain), clock_.tick(now_s()));
    const auto& status = host_.board_status();
    armed_ = !status || is_armed(status);
  }
  link_.reset();  // for whoever opens it next
}

void AttachedLoop::begin_anew() {
  host_.begin_anew();
  newest_model_ = {};
  fed_tick_.reset();
}

// It renders for a host that has gone, or for another one: nobody here has armed it.
void AttachedLoop::disarm_a_foundling() {
  if (armed_ || !is_armed(host_.board_status())) return;
  if (Clock::now() - disarmed_ < kReopenAfter) return;
  disarmed_ = Clock::now();
  (void)link_->write(host_.disarm().bytes);
}

void AttachedLoop::ask_a_silent_board() {
  if (heard_at_s_ - last_bytes_s_ < kSilence_s || heard_at_s_ - asked_at_s_ < kAskAgain_s) return;
  asked_at_s_ = heard_at_s_;
  (void)link_->write(host_.hello().bytes);
}

void AttachedLoop::run_once() {
  std::vector<std::function<void()>> controls;
  {
    const std::lock_guard lock(mutex_);
    controls.swap(controls_);
  }
  for (const auto& control : controls) control();
  if (!link_->is_open() && !open_again()) return;

  forget_what_waited();
  const std::vector<std::uint8_t> bytes = link_->read(kReadPatience);
  heard_at_s_ = now_s();
  if (!bytes.empty()) last_bytes_s_ = heard_at_s_;
  ask_a_silent_board();
  host_.receive(bytes, clock_.tick(heard_at_s_));
  note_models();
  disarm_a_foundling();
  poll_until(clock_.tick(now_s()));

  feed_.look_at(host_, polled_tick_);
  feed_.edit([this](LiveStatus& status) {
    const link::TransportCounters counters = link_->counters();
    status.down.bytes_accepted = status.down.bytes_delivered = bytes_down_ + counters.bytes_sent;
    status.down.submissions_dropped = counters.frames_unsent;
    status.up.bytes_accepted = status.up.bytes_delivered = bytes_up_ + counters.bytes_received;
    status.links_opened = links_opened_;
    status.link_is_open = link_->is_open();
    status.link_trouble = link_->trouble();
  });
}

void AttachedLoop::forget_what_waited() {
  const double now = now_s();
  const double since_s = now - std::exchange(ran_at_s_, now);
  if (since_s < kPause_s) return;
  while (now_s() - now < kPause_s && !link_->read(kReadPatience).empty()) {
  }
  ran_at_s_ = now_s();
}

bool AttachedLoop::open_again() {
  feed_.edit([](LiveStatus& status) { status.link_is_open = false; });
  if (Clock::now() - tried_ < kReopenAfter) {
    std::this_thread::sleep_for(kReadPatience);
    return false;
  }
  tried_ = Clock::now();
  const link::TransportCounters gone = link_->counters();
  try {
    link_ = link::open_transport(address_);
  } catch (const link::TransportError&) {
    return false;
  }
  bytes_down_ += gone.bytes_sent;
  bytes_up_ += gone.bytes_received;
  ++links_opened_;
  begin_anew();
  return true;
}

void AttachedLoop::take(const palpate_ServoTrace_1_0& trace) {
  // It was sent after its last tick; one that was asked for again is older, and says nothing new of the time.
  if (clock_.hear(trace.first_tick + static_cast<std::uint32_t>(trace.samples.count), heard_at_s_)) {
    begin_anew();
    armed_ = false;
  }
  const auto& status = host_.board_status();
  for (std::uint32_t i = 0; i < trace.samples.count; ++i) {
    const palpate_ServoSample_1_0& sample = trace.samples.elements[i];
    LiveTick tick;
    tick.loop.tick = trace.first_tick + i;
    // What was asked for again is the session's alone: records go forwards.
    if (fed_tick_ && static_cast<std::int32_t>(tick.loop.tick - *fed_tick_) <= 0) continue;
    fed_tick_ = tick.loop.tick;
    lockstep::ActuatorFrame& board = tick.loop.board;
    std::copy(std::begin(sample.tip_m), std::end(sample.tip_m), board.tip_m.begin());
    std::copy(std::begin(sample.force_N), std::end(sample.force_N), board.force_N.begin());
    board.tick = tick.loop.tick;
    board.contact_mode = sample.mode;
    board.triangle = sample.triangle;
    board.enabled = (sample.flags & palpate_ServoSample_1_0_FLAG_RENDERING) != 0 ? 1 : 0;
    board.mode = status ? status->mode : 0;
    board.faults = status ? status->faults : 0;
    board.model_sequence = newest_model_.sequence;
    board.model_age_ticks = newest_model_.sequence != 0 ? tick.loop.tick - newest_model_.model_tick : 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      tick.loop.true_tip_m[axis] = static_cast<double>(sample.tip_m[axis]);
    tick.loop.hand_target_m = tick.loop.true_tip_m;
    tick.loop.encoder_count = counts_at(tick.loop.true_tip_m);
    add_traffic(tick.loop);
    feed_.add(tick);
  }
}

device::EncoderCounts AttachedLoop::counts_at(const Vec3d& tip_m) const {
  device::EncoderCounts count = encoder_reference_;
  try {
    const device::EncoderCounts moved = arm_.encoder_counts(arm_.joint_angles_rad(tip_m, "tip"));
    for (std::size_t i = 0; i < 3; ++i) count[i] += moved[i];
  } catch (const std::invalid_argument&) {  // a device that was not calibrated may say anything
  }
  return count;
}

void AttachedLoop::add_traffic(LoopTick& tick) {
  const link::TransportCounters now = link_->counters();
  const std::uint64_t down = bytes_down_ + now.bytes_sent, up = bytes_up_ + now.bytes_received;
  tick.link_down_bytes = static_cast<std::uint32_t>(down - std::exchange(bytes_seen_down_, down));
  tick.link_up_bytes = static_cast<std::uint32_t>(up - std::exchange(bytes_seen_up_, up));
}

void AttachedLoop::note_models() {
  const std::vector<UpdateRecord>& updates = host_.updates();
  for (auto update = updates.rbegin(); update != updates.rend(); ++update) {
    if (update->status != static_cast<std::uint8_t>(Status::ok)) continue;
    newest_model_ = {update->sequence, update->tick};
    return;
  }
}

void AttachedLoop::poll_until(std::uint32_t tick) {
  const auto behind = static_cast<std::int32_t>(tick - polled_tick_);
  if (behind < 0 && behind > -static_cast<std::int32_t>(BoardClock::kRestart_ticks)) return;
  if (behind < 0 || behind > static_cast<std::int32_t>(kMostTicksAtOnce)) polled_tick_ = tick - 1;
  const double rate = link_->bytes_per_s();
  const double bytes_per_tick = rate > 0.0 ? rate / kTicksPerS : kUnknownBytesPerTick;
  while (polled_tick_ != tick) {
    ++polled_tick_;
    const double now = now_s();
    backlog_bytes_ = std::max(0.0, backlog_bytes_ - bytes_per_tick * kTicksPerS * (now - backlog_at_s_));
    backlog_at_s_ = now;
    for (const link::OutgoingFrame& frame :
         host_.poll(polled_tick_, static_cast<std::size_t>(backlog_bytes_), bytes_per_tick))
      write(frame);
  }
}

void AttachedLoop::write(const link::OutgoingFrame& frame) {
  if (link_->write(frame.bytes)) backlog_bytes_ += static_cast<double>(frame.bytes.size());
}

void AttachedLoop::post(std::function<void()> control) {
  if (!feed_.status().running) return;
  const std::lock_guard lock(mutex_);
  controls_.push_back(std::move(control));
}

void AttachedLoop::arm() {
  post([this] {
    armed_ = true;
    host_.arm();
  });
}

void AttachedLoop::command(firmware::Action action) {
  post([this, action] { host_.command(action); });
}

void AttachedLoop::set_host_delay(std::uint32_t ticks) {
  plant::require_range("host delay in ticks", ticks, 0.0, 1000.0);
  post([this, ticks] { host_.set_delay(ticks); });
}

}  // namespace palpate::host
