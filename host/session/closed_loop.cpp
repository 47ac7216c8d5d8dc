#include "host/session/closed_loop.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "host/link/host_endpoint.hpp"
#include "host/session/arming.hpp"
#include "host/session/basis_sender.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host {
namespace {

constexpr std::uint32_t kTicksPerReport = 10;

void require(bool good, const char* what) {
  if (!good) throw std::runtime_error(std::string("board: ") + what);
}

bool contains(const std::vector<std::uint32_t>& ticks, std::uint32_t tick) {
  return std::find(ticks.begin(), ticks.end(), tick) != ticks.end();
}

// The host: endpoint, arming, session, and frames that wait for the end of the computing delay.
class Host {
 public:
  Host(const Body& body, const BodyState& start, const ClosedLoopConfig& config)
      : config_(config), traces_(config.trace), session_(body, start, config.session) {
    // It repeats the board's rendering to the bit.
    if (config.session.feedback == Feedback::paper && config.trace.form != TraceForm::full)
      throw std::invalid_argument("trace: the paper's feedback needs the full one");
    result_.state_at_peak = start;
  }

  void receive(const std::vector<std::uint8_t>& bytes, std::uint32_t tick) {
    for (const link::Incoming& incoming : endpoint_.receive(bytes, tick))
      std::visit([this](const auto& message) { take(message); }, incoming);
  }

  // Frames that the host hands to the link in this tick. backlog_bytes: of what was handed to it, what has
  // not arrived. A model that would queue behind another is not computed before that one has arrived: a queue
  // of models, each older than the next, would reach the board too late for its tip history, all of them.
  // Pieces of a basis that is not needed yet go one at a time, in what the link has left of this tick.
  std::vector<link::OutgoingFrame> poll(std::uint32_t tick, std::size_t backlog_bytes,
                                        double link_bytes_per_tick) {
    std::vector<link::OutgoingFrame> frames;
    if (const auto command = arming_.poll(tick)) frames.push_back(endpoint_.encode(*command));
    if (const auto request = traces_.poll()) frames.push_back(endpoint_.encode(*request));
    session_.prepare();
    if (session_.due(tick)) model_is_due_ = true;
    if (model_is_due_ && backlog_bytes <= bytes_behind_model_ &&
        computing_.size() < config_.models_under_way) {
      model_is_due_ = false;
      if (auto update = session_.update()) {
        // Which patch it will be is known before the model is.
        begin_basis(*update);
        computing_.emplace_back(tick + config_.host_delay_ticks, std::move(*update));
      }
      // What is missing still after the next update is interpolated.
      for (const TickRange& gap : session_.missing())
        frames.push_back(endpoint_.encode(traces_.request(gap)));
    }
    if (held_back_) begin_basis(*held_back_);
    if (held_back_ && bases_.is_held(held_back_->packed.state.basis_id)) {
      send_state(*held_back_, tick, frames);
      held_back_.reset();
    }
    while (!computing_.empty() && computing_.front().first <= tick) {
      send(std::move(computing_.front().second), tick, frames);
      computing_.pop_front();
    }
    const double left_bytes = link_bytes_per_tick - static_cast<double>(backlog_bytes);
    if (frames.empty() && left_bytes > 0.0) {
      // What comes up meanwhile waits for a tick at most, and on a slow link for the rest of a block.
      const double blocks = left_bytes / palpate_ModelPart_1_0_BLOCK_BYTES;
      send_piece(static_cast<std::size_t>(std::clamp(blocks, 1.0, static_cast<double>(kMostBlocks))), tick,
                 frames);
    }
    return frames;
  }

  // `recorded`: every tick of the run, for what is known only afterwards.
  ClosedLoopResult finish(std::vector<LoopTick> recorded) {
    std::map<std::uint32_t, std::size_t> row;
    for (std::size_t i = 0; i < recorded.size(); ++i) row[recorded[i].tick] = i;
    for (const Session::Interpolated& guess : session_.interpolated()) {
      const auto found = row.find(guess.tick);
      if (found == row.end()) continue;
      const std::array<float, 3>& tip = recorded[found->second].board.tip_m;
      const Vec3d truth{static_cast<double>(tip[0]), static_cast<double>(tip[1]),
                        static_cast<double>(tip[2])};
      // Of the first model since then that was sent.
      const auto builds_on =
          std::find_if(result_.updates.begin(), result_.updates.end(),
                       [&](const UpdateRecord& update) { return update.sequence >= guess.sequence; });
      if (builds_on != result_.updates.end())
        builds_on->interpolation_error_m =
            std::max(builds_on->interpolation_error_m, norm(guess.tip_m - truth));
    }
    if (!has_peak_) {
      result_.state_at_peak = session_.state();
      result_.peak_tick = session_.tick();
    }
    if (const auto found = row.find(result_.peak_tick); found != row.end())
      result_.tip_at_peak_m = recorded[found->second].true_tip_m;
    const link::EndpointCounters counters = endpoint_.counters();
    // A frame that is refused for its CRC leaves a gap in the transfer identifiers too: the gaps count both.
    result_.counters.frames_lost_up = counters.frames_lost + counters.payloads_malformed;
    result_.counters.frames_lost_down = board_lost_;
    result_.counters.frames_repeated_up = counters.frames_repeated;
    result_.counters.basis_waits = session_.basis_waits();
    result_.bases = session_.builder().bases();
    if (config_.probe_node) result_.probe = replay(recorded, *config_.probe_node);
    result_.ticks = std::move(recorded);
    return std::move(result_);
  }

 private:
  // What the board rendered, tick by tick.
  Replay replay(const std::vector<LoopTick>& recorded, int node) {
    std::vector<RenderedTick> ticks;
    ticks.reserve(recorded.size());
    for (const LoopTick& row : recorded)
      ticks.push_back(
          {row.tick, {row.board.tip_m[0], row.board.tip_m[1], row.board.tip_m[2]}, row.board.model_sequence});
    return replay_models(ticks, sent_, node, config_.catch_up_policy);
  }

  static constexpr std::size_t kMostBlocks =
      palpate_ModelPart_1_0_data_ARRAY_CAPACITY_ / palpate_ModelPart_1_0_BLOCK_BYTES;

  // True when there was one.
  bool send_piece(std::size_t blocks, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
    const auto part = bases_.next(blocks, tick);
    if (!part) return false;
    frames.push_back(endpoint_.encode(*part));
    const std::size_t bytes = frames.back().bytes.size();
    bytes_behind_model_ += bytes;
    basis_bytes_ += bytes;
    return true;
  }

  // Brings the basis of the model to the board, or, where that is there, the one that will be wanted next;
  // one that is under way comes first, unless it is one that is only wanted next.
  void begin_basis(const ModelUpdate& update) {
    const std::uint32_t id = update.packed.state.basis_id;
    if (id == 0 || !update.basis_stays) return;
    if (!bases_.is_held(id)) {
      if (bases_.busy() && (bases_.id() == id || !is_ahead_)) return;
      bases_.begin(id, update.packed.basis);
      is_ahead_ = false;
    } else if (update.wanted_basis && !bases_.is_held(update.wanted_basis_id) && !bases_.busy()) {
      bases_.begin(update.wanted_basis_id, update.wanted_basis);
      is_ahead_ = true;
    }
  }

  // The state, and its basis where it has to come with it or is not on the board.
  void send(ModelUpdate update, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
    const std::uint32_t id = update.packed.state.basis_id;
    if (id != 0 && !update.basis_stays) {
      if (bases_.id() != id) bases_.begin(id, update.packed.basis);
      while (send_piece(kMostBlocks, tick, frames)) {
      }
    } else if (id != 0) {
      begin_basis(update);
      if (!bases_.is_held(id)) {
        // It waits here, not on the board, for the basis to come; a newer one takes its place.
        if (held_back_) update.interpolated_ticks += held_back_->interpolated_ticks;
        held_back_ = std::move(update);
        return;
      }
    }
    if (held_back_) update.interpolated_ticks += held_back_->interpolated_ticks;
    held_back_.reset();
    send_state(update, tick, frames);
  }

  void send_state(const ModelUpdate& update, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
    frames.push_back(endpoint_.encode(update.packed.state));
    bytes_behind_model_ = 0;
    UpdateRecord record;
    record.sequence = update.message.sequence;
    record.tick = update.message.tick;
    record.sent_tick = tick;
    record.modes = update.message.modes;
    record.nodes = update.message.nodes;
    record.bytes = static_cast<std::uint32_t>(frames.back().bytes.size());
    record.basis_bytes = static_cast<std::uint32_t>(std::exchange(basis_bytes_, 0));
    record.interpolated_ticks = update.interpolated_ticks;
    record.damping_coupling = update.damping_coupling;
    record.limited_modes = update.limited_modes;
    result_.updates.push_back(record);
    if (config_.probe_node) sent_.push_back({update.packed, update.patch_nodes});
    ++result_.counters.models_sent;

    const float* force = update.message.contact.force_N;
    const double force_N = norm(
        Vec3d{static_cast<double>(force[0]), static_cast<double>(force[1]), static_cast<double>(force[2])});
    if (!has_peak_ || force_N > peak_N_) {
      has_peak_ = true;
      peak_N_ = force_N;
      result_.state_at_peak = update.state;
      result_.peak_tick = record.tick;
      result_.patch_at_peak = update.patch_nodes;
    }
  }

  void take(const palpate_ServoTrace_1_0& trace) { session_.take(trace); }
  void take(const palpate_TipTrace_1_0& trace) { session_.take(trace); }
  void take(const palpate_BoardStatus_1_0& status) {
    require(status.schema_hash == wire::kSchemaHash,
            "it was built from other message definitions than the host: build both from the same version");
    arming_.take(status);
    traces_.take(status);
    board_lost_ = status.frames_lost;
  }
  void take(const palpate_ModelReport_1_0& report) {
    for (UpdateRecord& update : result_.updates) {
      // What was taken over stays so, even if it came twice and the second one was refused.
      if (update.sequence != report.sequence || update.status == static_cast<std::uint8_t>(Status::ok))
        continue;
      update.status = report.status;
      update.swap_tick = report.swap_tick;
      update.correction_energy_J = report.correction_energy_J;
      if (report.status == static_cast<std::uint8_t>(Status::ok))
        session_.note_taken(update.tick, report.swap_tick);
    }
    if (report.status == static_cast<std::uint8_t>(Status::ok)) {
      ++result_.counters.models_taken;
    } else {
      ++result_.counters.models_refused;
    }
  }
  void take(const palpate_BasisReport_1_0& report) {
    bases_.take(report);
    session_.note_held_bases(bases_.held());
  }
  void take(const link::CommandResponse& response) { arming_.take(response.message); }
  void take(const link::InfoResponse&) {}

  const ClosedLoopConfig& config_;
  link::HostEndpoint endpoint_;
  Arming arming_;
  TraceChoice traces_;
  Session session_;
  bool model_is_due_ = false;
  std::deque<std::pair<std::uint32_t, ModelUpdate>> computing_;  // due tick, update
  BasisSender bases_;
  bool is_ahead_ = false;                 // the one under way is for a state to come
  std::optional<ModelUpdate> held_back_;  // until its basis is on the board
  // Of pieces that were handed to the link after the newest state.
  std::size_t bytes_behind_model_ = std::size_t{1} << 40;
  std::size_t basis_bytes_ = 0;  // sent since the newest state
  std::vector<SentModel> sent_;  // with a probe only
  ClosedLoopResult result_;
  bool has_peak_ = false;
  double peak_N_ = 0.0;
  std::uint32_t board_lost_ = 0;  // as the board counts
};

}  // namespace

void FileDescriptorPeer::send(const lockstep::SensorFrame& frame) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&frame);
  for (std::size_t done = 0; done < sizeof frame;) {
    const ssize_t count = ::write(sensor_fd_, bytes + done, sizeof frame - done);
    if (count < 0 && errno == EINTR) continue;
    require(count > 0, "its sensor stream is closed");
    done += static_cast<std::size_t>(count);
  }
}

void FileDescriptorPeer::receive(lockstep::ActuatorFrame& frame) {
  auto* bytes = reinterpret_cast<std::byte*>(&frame);
  for (std::size_t done = 0; done < sizeof frame;) {
    const ssize_t count = ::read(actuator_fd_, bytes + done, sizeof frame - done);
    if (count < 0 && errno == EINTR) continue;
    require(count > 0, "its actuator stream ended");
    done += static_cast<std::size_t>(count);
  }
}

ClosedLoopResult run_closed_loop(const Body& body, const BodyState& start, plant::Plant& plant,
                                 LockstepPeer& board, link::Medium& down, link::Medium& up,
                                 const ClosedLoopConfig& config, const Progress& progress) {
  Host host(body, start, config);
  link::FaultPlan faults_down(config.faults_down), faults_up(config.faults_up);
  std::vector<LoopTick> recorded;
  recorded.reserve(config.ticks);
  std::size_t next_grip = 0;
  std::deque<std::uint8_t> to_board;

  std::uint32_t tick = 0;
  while (tick < config.ticks) {
    for (; next_grip < config.grip_changes.size() && config.grip_changes[next_grip].tick <= tick; ++next_grip)
      plant.set_grip(config.grip_changes[next_grip].grip);

    lockstep::SensorFrame sensors{};
    sensors.magic = lockstep::kSensorMagic;
    sensors.tick = tick;
    sensors.encoder_count = plant.encoder_counts();
    sensors.current_A = plant.measured_current_A();
    if (contains(config.emergency_stop_ticks, tick)) sensors.flags |= lockstep::kEmergencyStop;
    if (contains(config.overlong_ticks, tick)) sensors.flags |= lockstep::kBurnCycles;
    // After lost ticks more has arrived than the exchange holds: the rest waits for the ticks to come.
    const std::vector<std::uint8_t> arrived = down.deliver(tick);
    to_board.insert(to_board.end(), arrived.begin(), arrived.end());
    const std::size_t length = std::min(to_board.size(), sensors.link.size());
    sensors.link_length = static_cast<std::uint32_t>(length);
    const auto end_of_tick = to_board.begin() + static_cast<std::ptrdiff_t>(length);
    std::copy(to_board.begin(), end_of_tick, sensors.link.begin());
    to_board.erase(to_board.begin(), end_of_tick);

    LoopTick& row = recorded.emplace_back();
    row.tick = tick;
    row.encoder_count = sensors.encoder_count;
    row.measured_current_A = sensors.current_A;
    row.true_tip_m = plant.tip_position_m();
    row.hand_target_m = plant.intended_position_m();
    row.hand_force_N = plant.hand_force_N();

    board.send(sensors);
    board.receive(row.board);
    require(row.board.magic == lockstep::kActuatorMagic && row.board.tick == tick &&
                row.board.link_length <= row.board.link.size(),
            "its actuator frame has a wrong magic number, tick or length");
    require(row.board.next_tick > tick, "its next tick is not after the present one");
    const std::uint32_t elapsed = row.board.next_tick - tick;  // more than 1 where deadlines were missed

    (void)up.submit(faults_up.apply(std::span(row.board.link).first(row.board.link_length)), tick);
    plant.advance(row.board.setpoint_A, row.board.enabled != 0, elapsed * kTick_s);
    tick += elapsed;

    const std::vector<std::uint8_t> to_host = up.deliver(tick);
    row.link_up_bytes = static_cast<std::uint32_t>(to_host.size());
    row.link_down_bytes = sensors.link_length;
    host.receive(to_host, tick);
    for (const link::OutgoingFrame& frame : host.poll(tick, down.backlog_bytes(tick), down.bytes_per_tick()))
      (void)down.submit(faults_down.apply(frame.bytes), tick);

    if (recorded.size() % kTicksPerReport == 0 && progress &&
        !progress(std::min(tick, config.ticks), config.ticks))
      throw std::runtime_error("stopped");
  }

  lockstep::SensorFrame last{};
  last.magic = lockstep::kSensorMagic;
  last.tick = tick;
  last.flags = lockstep::kShutdown;
  last.encoder_count = plant.encoder_counts();
  board.send(last);
  lockstep::ActuatorFrame farewell{};
  board.receive(farewell);
  return host.finish(std::move(recorded));
}

}  // namespace palpate::host
