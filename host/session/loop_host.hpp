// The host's end of the loop: endpoint, arming, session, and frames that wait for the end of the computing
// delay.
#pragma once

#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/core/supervisor.hpp"
#include "host/link/host_endpoint.hpp"
#include "host/session/arming.hpp"
#include "host/session/basis_sender.hpp"
#include "host/session/closed_loop_config.hpp"
#include "host/session/loop_record.hpp"
#include "host/session/node_probe.hpp"
#include "host/session/session.hpp"
#include "host/session/trace_choice.hpp"

namespace palpate::host {

class LoopHost {
 public:
  // `body` must outlive it. Throws as Session does, and std::invalid_argument for Feedback::paper without
  // full traces.
  LoopHost(const Body& body, const BodyState& start, const ClosedLoopConfig& config);

  void receive(const std::vector<std::uint8_t>& bytes, std::uint32_t tick);

  // Frames that the host hands to the link in this tick. backlog_bytes: of what was handed to it, what has
  // not arrived. A model that would queue behind another is not computed before that one has arrived: a queue
  // of models, each older than the next, would reach the board too late for its tip history, all of them.
  // Pieces of a basis that is not needed yet go one at a time, in what the link has left of this tick.
  std::vector<link::OutgoingFrame> poll(std::uint32_t tick, std::size_t backlog_bytes,
                                        double link_bytes_per_tick);

  // Is told every full trace, before the session is.
  void listen(std::function<void(const palpate_ServoTrace_1_0&)> listener) {
    listener_ = std::move(listener);
  }

  // Is told which ticks have come, their tips at least, in which tick: the first of them, how many, now.
  void listen_to_ticks(std::function<void(std::uint32_t, std::uint32_t, std::uint32_t)> listener) {
    tick_listener_ = std::move(listener);
  }

  // What a person asks for. Arming takes its two steps (arming.hpp); any other action goes out as it is, and
  // ends what is left of them.
  void arm() { arming_.begin(); }
  void cancel_arming() { arming_.cancel(); }
  void command(firmware::Action action);
  // Of a board that has started again, or whose link was gone: what is under way for the one before is
  // forgotten, and so is what a person asked for, but for what switches off.
  void begin_anew();
  // Frames to be handed to the link at once. hello: a question that any board answers.
  link::OutgoingFrame hello();
  link::OutgoingFrame disarm();
  // For models that are begun from now on.
  void set_delay(std::uint32_t ticks) { config_.host_delay_ticks = ticks; }

  // Of a session that runs beside the loop only while it is not busy.
  [[nodiscard]] const Session& session() const { return session_; }
  // A model is being computed beside the loop.
  [[nodiscard]] bool is_busy() const { return update_.valid(); }
  // How long it has been, at this tick.
  [[nodiscard]] std::uint32_t busy_ticks(std::uint32_t tick) const {
    return is_busy() ? tick - begun_tick_ : 0;
  }
  // False when it is not there after that time.
  [[nodiscard]] bool wait_until_computed(std::chrono::milliseconds longest) const {
    return !is_busy() || update_.wait_for(longest) == std::future_status::ready;
  }
  [[nodiscard]] const std::vector<UpdateRecord>& updates() const { return result_.updates; }
  // Forgets the oldest; finish() then lacks them.
  void forget_updates(std::size_t count) {
    result_.updates.erase(result_.updates.begin(),
                          result_.updates.begin() + static_cast<std::ptrdiff_t>(count));
  }
  [[nodiscard]] LoopCounters counters() const;
  // As the board said last, if it has.
  [[nodiscard]] const std::optional<palpate_BoardStatus_1_0>& board_status() const { return board_status_; }
  // That the board has given up, by what it has said since it was heard first (BoardStatus.frames_unsent).
  [[nodiscard]] std::uint64_t frames_unsent() const { return frames_unsent_; }
  // Of the newest model, the body's own numbers; empty before the first.
  [[nodiscard]] const std::vector<int>& patch_nodes() const { return patch_nodes_; }

  // `recorded`: every tick of the run, for what is known only afterwards. The host is done then.
  ClosedLoopResult finish(std::vector<LoopTick> recorded);

 private:
  // A board that renders hears something this often, or takes its link for lost (docs/safety.md); not of a
  // session that computes for longer than the other.
  static constexpr std::uint32_t kSignOfLife_ticks = 100;
  static constexpr std::uint32_t kAskAgain_ticks = 200;
  static constexpr std::uint32_t kLongestUpdate_ticks = 1000;
  static constexpr std::size_t kMostBlocks =
      palpate_ModelPart_1_0_data_ARRAY_CAPACITY_ / palpate_ModelPart_1_0_BLOCK_BYTES;

  [[nodiscard]] Replay replay(const std::vector<LoopTick>& recorded, int node);
  // Now, or when the model that is being computed beside the loop is there.
  void tell_session(std::function<void(Session&)> news);
  // May it be armed? Asks who it is as long as somebody wants to know. Throws std::runtime_error for a
  // board that is none of ClosedLoopConfig::known_boards.
  bool knows_board(std::uint32_t tick, std::vector<link::OutgoingFrame>& frames);
  // Where nothing else goes out: the wish for traces, which says nothing new.
  void add_sign_of_life(std::uint32_t tick, std::vector<link::OutgoingFrame>& frames);
  // Takes over what has been computed. Its frames ask for ticks that are missing.
  void take_model(std::optional<ModelUpdate> update, std::vector<link::OutgoingFrame>& frames);
  // True when there was one.
  bool send_piece(std::size_t blocks, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames);
  // Brings the basis of the model to the board, or, where that is there, the one that will be wanted next;
  // one that is under way comes first, unless it is one that is only wanted next.
  void begin_basis(const ModelUpdate& update);
  // The state, and its basis where it has to come with it or is not on the board.
  void send(ModelUpdate update, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames);
  void send_state(const ModelUpdate& update, std::uint32_t tick, std::vector<link::OutgoingFrame>& frames);
  template <class Trace>
  requires std::same_as<Trace, palpate_ServoTrace_1_0> || std::same_as<Trace, palpate_TipTrace_1_0>
  void take(const Trace& trace) {
    std::uint32_t count = 0;
    if constexpr (std::same_as<Trace, palpate_ServoTrace_1_0>) {
      count = static_cast<std::uint32_t>(trace.samples.count);
      if (listener_) listener_(trace);
    } else {
      count = 1 + static_cast<std::uint32_t>(trace.offsets.count);
    }
    if (tick_listener_) tick_listener_(trace.first_tick, count, received_tick_);
    tell_session([trace](Session& session) { session.take(trace); });
  }
  void take(const palpate_BoardStatus_1_0& status);
  void take(const palpate_ModelReport_1_0& report);
  void take(const palpate_BasisReport_1_0& report);
  void take(const link::CommandResponse& response) { arming_.take(response.message); }
  void take(const link::InfoResponse& response);
  void take(const palpate_DeviceState_1_0&) {}  // asked for by other programs
  void take(const link::RegisterAnswer&) {}
  void take(const link::RegisterName&) {}

  ClosedLoopConfig config_;
  link::HostEndpoint endpoint_;
  Arming arming_;
  std::deque<firmware::Action> actions_;  // asked for, not sent yet
  TraceChoice traces_;
  std::uint32_t sent_tick_ = 0;  // the newest frame to the link
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
  std::vector<int> patch_nodes_;
  std::function<void(const palpate_ServoTrace_1_0&)> listener_;
  std::function<void(std::uint32_t, std::uint32_t, std::uint32_t)> tick_listener_;
  std::optional<palpate_BoardStatus_1_0> board_status_;
  std::uint64_t frames_unsent_ = 0;
  std::optional<std::string> board_name_;
  std::optional<std::uint32_t> asked_name_tick_;
  ClosedLoopResult result_;
  bool has_peak_ = false;
  double peak_N_ = 0.0;
  // Beside the loop (ClosedLoopConfig::session_beside); last, for its thread uses what is above.
  std::uint32_t begun_tick_ = 0;
  std::uint32_t received_tick_ = 0;                  // the newest bytes
  std::uint64_t basis_waits_ = 0;                    // when it was not busy last
  std::vector<std::function<void(Session&)>> news_;  // for the session, when it is not busy any more
  std::future<std::optional<ModelUpdate>> update_;
};

}  // namespace palpate::host
