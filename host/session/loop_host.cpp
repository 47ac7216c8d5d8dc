#include "host/session/loop_host.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <variant>

#include "host/link/known_boards.hpp"
#include "host/session/lockstep_peer.hpp"

namespace palpate::host {
namespace {

// A person presses no more buttons in a tick.
constexpr std::size_t kMostActions = 16;

}  // namespace

LoopHost::LoopHost(const Body& body, const BodyState& start, const ClosedLoopConfig& config)
    : config_(config),
      endpoint_({.first_transfer_id = config.first_transfer_id, .framing = config.framing}),
      arming_(config.arms_by_itself),
      traces_(config.trace),
      session_(body, start, config.session) {
  // It repeats the board's rendering to the bit.
  if (config.session.feedback == Feedback::paper && config.trace.form != TraceForm::full)
    throw std::invalid_argument("trace: the paper's feedback needs the full one");
  result_.state_at_peak = start;
}

void LoopHost::receive(const std::vector<std::uint8_t>& bytes, std::uint32_t tick) {
  received_tick_ = tick;
  for (const link::Incoming& incoming : endpoint_.receive(bytes, tick))
    std::visit([this](const auto& message) { take(message); }, incoming);
}

void LoopHost::begin_anew() {
  arming_.cancel();
  std::erase_if(actions_, [](firmware::Action action) {
    return action != firmware::Action::stop && action != firmware::Action::disarm;
  });
  computing_.clear();
  held_back_.reset();
  bases_ = {};
  board_status_.reset();
  board_name_.reset();
  asked_name_tick_.reset();
}

bool LoopHost::knows_board(std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
  const std::vector<std::string>& known = config_.known_boards;
  if (known.empty()) return true;
  if (board_name_) {
    const bool is_known = std::find(known.begin(), known.end(), *board_name_) != known.end();
    const std::vector<std::string_view> names(known.begin(), known.end());
    require_of_board(is_known, link::unknown_board_text(*board_name_, names).c_str());
    return true;
  }
  if (!asked_name_tick_ || tick - *asked_name_tick_ >= kAskAgain_ticks) {
    asked_name_tick_ = tick;
    frames.push_back(hello());
  }
  return false;
}

link::OutgoingFrame LoopHost::hello() {
  return endpoint_.encode(palpate_GetInfo_Request_1_0{});
}

link::OutgoingFrame LoopHost::disarm() {
  palpate_Command_Request_1_0 request{};
  request.action = palpate_Command_Request_1_0_DISARM;
  return endpoint_.encode(request);
}

void LoopHost::command(firmware::Action action) {
  arming_.cancel();
  if (actions_.size() < kMostActions) actions_.push_back(action);
}

std::vector<link::OutgoingFrame> LoopHost::poll(std::uint32_t tick, std::size_t backlog_bytes,
                                                double link_bytes_per_tick) {
  std::vector<link::OutgoingFrame> frames;
  if (arming_.is_wanted() && knows_board(tick, frames))
    if (const auto command = arming_.poll(tick)) frames.push_back(endpoint_.encode(*command));
  for (; !actions_.empty(); actions_.pop_front()) {
    palpate_Command_Request_1_0 request{};
    request.action = static_cast<std::uint8_t>(actions_.front());
    frames.push_back(endpoint_.encode(request));
  }
  if (const auto request = traces_.poll()) frames.push_back(endpoint_.encode(*request));
  bool was_computed = false;
  if (is_busy() && update_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    was_computed = true;
    take_model(update_.get(), frames);
    for (const auto& news : news_) news(session_);
    news_.clear();
  }
  if (!is_busy()) session_.prepare();
  if (session_.due(tick)) model_is_due_ = true;
  // The next one begins a tick later: who wants to see the session's body sees it in between.
  if (model_is_due_ && !is_busy() && !was_computed && backlog_bytes <= bytes_behind_model_ &&
      computing_.size() < config_.models_under_way) {
    model_is_due_ = false;
    begun_tick_ = tick;
    basis_waits_ = session_.basis_waits();
    if (config_.session_beside) {
      update_ = std::async(std::launch::async, [this] { return session_.update(); });
    } else {
      take_model(session_.update(), frames);
    }
  }
  if (held_back_) begin_basis(*held_back_);
  if (held_back_ && bases_.is_held(held_back_->packed.state.basis_id)) {
    send_state(*held_back_, tick, frames);
    held_back_.reset();
  }
  while (!computing_.empty() && static_cast<std::int32_t>(tick - computing_.front().first) >= 0) {
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
  add_sign_of_life(tick, frames);
  return frames;
}

void LoopHost::add_sign_of_life(std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
  if (!frames.empty()) sent_tick_ = tick;
  if (!board_status_ || busy_ticks(tick) > kLongestUpdate_ticks) return;
  const auto mode = static_cast<firmware::Mode>(board_status_->mode);
  if (!firmware::is_armed(mode) || mode == firmware::Mode::direct) return;
  if (tick - sent_tick_ < kSignOfLife_ticks) return;
  sent_tick_ = tick;
  frames.push_back(endpoint_.encode(traces_.request({})));
}

void LoopHost::take_model(std::optional<ModelUpdate> update, std::vector<link::OutgoingFrame>& frames) {
  if (update) {
    // Which patch it will be is known before the model is.
    begin_basis(*update);
    computing_.emplace_back(begun_tick_ + config_.host_delay_ticks, std::move(*update));
  }
  // What is missing still after the next update is interpolated.
  for (const TickRange& gap : session_.missing()) frames.push_back(endpoint_.encode(traces_.request(gap)));
}

void LoopHost::tell_session(std::function<void(Session&)> news) {
  if (is_busy()) {
    news_.push_back(std::move(news));
  } else {
    news(session_);
  }
}

LoopCounters LoopHost::counters() const {
  LoopCounters counters = result_.counters;
  const link::EndpointCounters heard = endpoint_.counters();
  // A frame that is refused for its CRC leaves a gap in the transfer identifiers too: the gaps count both.
  counters.frames_lost_up = heard.frames_lost + heard.payloads_malformed;
  counters.frames_lost_down = board_status_ ? board_status_->frames_lost : 0;
  counters.frames_repeated_up = heard.frames_repeated;
  counters.frames_late_up = heard.frames_late;
  counters.basis_waits = is_busy() ? basis_waits_ : session_.basis_waits();
  return counters;
}

ClosedLoopResult LoopHost::finish(std::vector<LoopTick> recorded) {
  std::map<std::uint32_t, std::size_t> row;
  for (std::size_t i = 0; i < recorded.size(); ++i) row[recorded[i].tick] = i;
  for (const Session::Interpolated& guess : session_.interpolated()) {
    const auto found = row.find(guess.tick);
    if (found == row.end()) continue;
    const std::array<float, 3>& tip = recorded[found->second].board.tip_m;
    const Vec3d truth{static_cast<double>(tip[0]), static_cast<double>(tip[1]), static_cast<double>(tip[2])};
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
  result_.counters = counters();
  result_.bases = session_.builder().bases();
  if (config_.probe_node) result_.probe = replay(recorded, *config_.probe_node);
  result_.ticks = std::move(recorded);
  return std::move(result_);
}

// What the board rendered, tick by tick.
Replay LoopHost::replay(const std::vector<LoopTick>& recorded, int node) {
  std::vector<RenderedTick> ticks;
  ticks.reserve(recorded.size());
  for (const LoopTick& row : recorded)
    ticks.push_back(
        {row.tick, {row.board.tip_m[0], row.board.tip_m[1], row.board.tip_m[2]}, row.board.model_sequence});
  return replay_models(ticks, sent_, node, config_.catch_up_policy);
}

bool LoopHost::send_piece(std::size_t blocks, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
  const auto part = bases_.next(blocks, tick);
  if (!part) return false;
  frames.push_back(endpoint_.encode(*part));
  const std::size_t bytes = frames.back().bytes.size();
  bytes_behind_model_ += bytes;
  basis_bytes_ += bytes;
  return true;
}

void LoopHost::begin_basis(const ModelUpdate& update) {
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

void LoopHost::send(ModelUpdate update, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames) {
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

void LoopHost::send_state(const ModelUpdate& update, std::uint32_t tick,
                          std::vector<link::OutgoingFrame>& frames) {
  palpate_ModelState_1_0 state = update.packed.state;
  if (contains(config_.troubles.other_schema, tick)) state.schema_hash = ~state.schema_hash;
  frames.push_back(endpoint_.encode(state));
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
  patch_nodes_ = update.patch_nodes;
  ++result_.counters.models_sent;

  const float* force = update.message.contact.force_N;
  const double force_N = norm(
      Vec3d{static_cast<double>(force[0]), static_cast<double>(force[1]), static_cast<double>(force[2])});
  if (!update.says_nothing() && (!has_peak_ || force_N > peak_N_)) {
    has_peak_ = true;
    peak_N_ = force_N;
    result_.state_at_peak = update.state;
    result_.peak_tick = record.tick;
    result_.patch_at_peak = update.patch_nodes;
  }
}

void LoopHost::take(const palpate_BoardStatus_1_0& status) {
  require_of_board(
      status.schema_hash == wire::kSchemaHash,
      "it was built from other message definitions than the host: build both from the same version");
  arming_.take(status);
  traces_.take(status);
  if (board_status_ && status.frames_unsent > board_status_->frames_unsent)
    frames_unsent_ += status.frames_unsent - board_status_->frames_unsent;
  board_status_ = status;
  if (status.mode == palpate_BoardStatus_1_0_MODE_SUSPENDED)
    tell_session([](Session& session) { session.note_suspended(); });
}

void LoopHost::take(const link::InfoResponse& response) {
  require_of_board(
      response.message.schema_hash == wire::kSchemaHash,
      "it was built from other message definitions than the host: build both from the same version");
  const auto& board = response.message.board;
  board_name_.emplace(board.elements, board.elements + board.count);
}

void LoopHost::take(const palpate_ModelReport_1_0& report) {
  // Newest first: it is one of the last.
  for (auto it = result_.updates.rbegin(); it != result_.updates.rend(); ++it) {
    UpdateRecord& update = *it;
    if (update.sequence < report.sequence) break;
    // What was taken over stays so, even if it came twice and the second one was refused.
    if (update.sequence != report.sequence || update.status == static_cast<std::uint8_t>(Status::ok))
      continue;
    update.status = report.status;
    update.swap_tick = report.swap_tick;
    update.correction_energy_J = report.correction_energy_J;
    if (report.status == static_cast<std::uint8_t>(Status::ok))
      tell_session([model_tick = update.tick, swap_tick = report.swap_tick](Session& session) {
        session.note_taken(model_tick, swap_tick);
      });
  }
  if (report.status == static_cast<std::uint8_t>(Status::ok)) {
    ++result_.counters.models_taken;
  } else {
    ++result_.counters.models_refused;
  }
}
void LoopHost::take(const palpate_BasisReport_1_0& report) {
  bases_.take(report);
  tell_session([held = bases_.held()](Session& session) { session.note_held_bases(held); });
}

}  // namespace palpate::host
