#include "firmware/link/endpoint.hpp"

#include <algorithm>
#include <bit>
#include <limits>

namespace palpate::firmware {
namespace {

// Bytes moved out of the receive ring at a time; small, for it lies on the stack.
constexpr std::size_t kChunk = 128;

template <class Array>
void set_text(Array& field, std::string_view text) {
  field.count = std::min(text.size(), sizeof(field.elements));
  std::copy_n(text.begin(), field.count, field.elements);
}

palpate_ServoSample_1_0 to_message(const ServoSample& sample) {
  palpate_ServoSample_1_0 message{};
  for (std::size_t i = 0; i < 3; ++i) {
    message.tip_m[i] = sample.tip_m[i];
    message.force_N[i] = sample.force_N[i];
  }
  message.mode = static_cast<std::uint8_t>(sample.mode);
  message.flags = sample.flags;
  message.triangle = sample.triangle;
  return message;
}

// A board that has stopped itself cannot do what it is for; one that was stopped could. (One that is armed
// or idle is well.)
wire::NodeHealth health_of(FaultSet faults) {
  constexpr FaultSet kStoppedByHand = bit(Fault::emergency_stop) | bit(Fault::stop_command);
  if (faults == 0) return wire::NodeHealth::nominal;
  return (faults & ~kStoppedByHand) == 0 ? wire::NodeHealth::caution : wire::NodeHealth::warning;
}

wire::NodeMode node_mode_of(Mode mode) {
  if (mode == Mode::boot) return wire::NodeMode::initialization;
  return mode == Mode::calibrate ? wire::NodeMode::maintenance : wire::NodeMode::operational;
}

// What the motions of an armed board depend on.
bool is_for_the_host_that_armed(std::uint16_t specifier) {
  return specifier == wire::MessageTraits<palpate_ModelState_1_0>::kSpecifier ||
         specifier == wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier ||
         specifier == wire::MessageTraits<palpate_TraceRequest_1_0>::kSpecifier;
}

}  // namespace

void Endpoint::run() {
  send_urgent_replies();  // to those before the ones that come now
  receive();
  send_time();
  ModelReport report;
  if (renderer_.catch_up(report)) note(report);
  send_model_reports();
  send_replies();
  send_register_answers();
  send_status();
  send_heartbeat();
  send_traces();
  resend_traces();
}

void Endpoint::receive() {
  std::array<std::uint8_t, kChunk> chunk{};
  // The ring may be filled while it is emptied: not more than it holds, or a busy link could hold up the
  // rest.
  for (std::size_t i = 0; i < kLinkReceiveCapacity / kChunk; ++i) {
    std::span<const std::uint8_t> bytes(chunk.data(), link_.received.read(chunk));
    if (bytes.empty()) return;
    for (bool more = true; more;) {
      const wire::Reception reception = framing_.receive(bytes, servo_.next_tick());
      more = reception.complete;
      bytes = bytes.subspan(reception.consumed);
      const wire::ReceiverCounters& seen = framing_.counters();
      if (seen.refused() != faults_seen_) {
        faults_seen_ = seen.refused();
        counters_.last_status = seen.last_fault;
      }
      if (reception.complete) dispatch(reception.frame);
    }
  }
}

void Endpoint::dispatch(const wire::Frame& frame) {
  const wire::FrameHeader& header = frame.header;
  if (!wire::addressed_to(header, wire::kBoardNode)) return;  // for another node: none of ours
  if (wire::is_standard_message(header.specifier)) {          // heartbeats of others, and the like
    if (header.specifier == wire::kHeartbeatSubject) {
      node_seen_ = true;
      node_seen_tick_ = servo_.next_tick();
    }
    return;
  }
  if (transfers_.observe(header, servo_.next_tick()) == wire::TransferKind::repeat) return;
  if (header.source == mailbox_.armed_node.load(std::memory_order_relaxed))
    mailbox_.host_frames.store(mailbox_.host_frames.load(std::memory_order_relaxed) + 1,
                               std::memory_order_relaxed);
  Status status = Status::port_unknown;
  if (is_for_the_host_that_armed(header.specifier) && is_refused_from(header.source)) {
    refuse(Status::command_refused);
    return;
  }
  switch (header.specifier) {
    case wire::MessageTraits<palpate_ModelState_1_0>::kSpecifier: {
      ModelReport report;
      note_model_of(header.source);
      if (renderer_.accept(frame.payload, report) != Status::ok) note(report);
      send_model_reports();
      return;
    }
    case wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier:
      status = renderer_.accept_part(frame.payload);
      send_model_reports();
      break;
    case wire::MessageTraits<palpate_TraceRequest_1_0>::kSpecifier:
      status = take_trace_request(frame);
      break;
    case wire::MessageTraits<palpate_DirectForce_1_0>::kSpecifier:
      status = take_direct_force(frame);
      break;
    case wire::MessageTraits<palpate_Command_Request_1_0>::kSpecifier:
      status = take_command(frame);
      break;
    case wire::MessageTraits<palpate_GetInfo_Request_1_0>::kSpecifier:
      status = send_info(frame);
      break;
    case wire::request_specifier(wire::kNodeInfoService):
      status = send_node_info(frame);
      break;
    case wire::MessageTraits<wire::RegisterAccessRequest>::kSpecifier:
      status = take_register_access(frame);
      break;
    case wire::MessageTraits<wire::RegisterListRequest>::kSpecifier:
      status = send_register_name(frame);
      break;
    default:
      break;
  }
  if (status != Status::ok) refuse(status);
}

Status Endpoint::take_command(const wire::Frame& frame) {
  palpate_Command_Request_1_0 request;
  if (const Status status = wire::deserialize(frame.payload, request); status != Status::ok) return status;
  const auto action = static_cast<Action>(request.action);
  const Requester requester{frame.header.source, frame.header.transfer_id};
  if (action == Action::stop || action == Action::disarm) {
    take_urgent(action, requester);
    return Status::ok;
  }
  return mailbox_.commands.push({{action, request._token}, requester}) ? Status::ok : Status::command_refused;
}

void Endpoint::take_urgent(Action action, const Requester& requester) {
  std::atomic<std::uint32_t>& asked = action == Action::stop ? mailbox_.stops : mailbox_.disarms;
  asked.store(asked.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (urgent_count_ < urgent_.size()) {
    urgent_[urgent_count_++] = requester;
  } else {
    ++counters_.frames_unsent;
  }
}

Status Endpoint::send_info(const wire::Frame& frame) {
  palpate_GetInfo_Response_1_0 info{};
  info.schema_hash = wire::kSchemaHash;
  set_text(info.board, identity_.board);
  set_text(info.firmware, identity_.firmware);
  info.max_modes = kMaxModes;
  info.max_basis = kMaxBasis;
  info.max_nodes = kMaxSurfaceNodes;
  info.max_triangles = kMaxTriangles;
  info.max_springs = kMaxSprings;
  info.max_basis_bytes = wire::kMaxBasisBytes;
  info.basis_slots = kBasisSlots;
  info.tick_rate_Hz = kServoRate_Hz;
  info.tip_history_ticks = kTipHistory;
  info.direct_force_N = limits_.direct_force_N;
  info.direct_force_step_N = limits_.direct_force_step_N;
  info.direct_hold_ticks = static_cast<std::uint16_t>(limits_.direct_hold_ticks);
  (void)send(info, response<palpate_GetInfo_Response_1_0>({frame.header.source, frame.header.transfer_id}));
  return Status::ok;
}

Status Endpoint::send_node_info(const wire::Frame& frame) {
  // No hardware version: no board has one to tell.
  const wire::NodeInfo info{.hardware = {},
                            .software = wire::node_version(identity_.firmware),
                            .unique_id = identity_.unique_id,
                            .board = identity_.board};
  (void)send(info, response<wire::NodeInfo>({frame.header.source, frame.header.transfer_id}));
  return Status::ok;
}

Status Endpoint::take_register_access(const wire::Frame& frame) {
  wire::RegisterAccessRequest request;
  if (const Status status = wire::deserialize(frame.payload, request); status != Status::ok) return status;
  return registers_.take(request, {frame.header.source, frame.header.transfer_id}) ? Status::ok
                                                                                   : Status::command_refused;
}

Status Endpoint::send_register_name(const wire::Frame& frame) {
  wire::RegisterListRequest request;
  if (const Status status = wire::deserialize(frame.payload, request); status != Status::ok) return status;
  (void)send(wire::RegisterListResponse{registers_.name(request.index)},
             response<wire::RegisterListResponse>({frame.header.source, frame.header.transfer_id}));
  return Status::ok;
}

void Endpoint::send_register_answers() {
  Registers::Answer answer;
  while (registers_.next(answer, servo_.next_tick()))
    (void)send(answer.response, response<wire::RegisterAccessResponse>(answer.requester));
}

Status Endpoint::take_trace_request(const wire::Frame& frame) {
  palpate_TraceRequest_1_0 request;
  if (const Status status = wire::deserialize(frame.payload, request); status != Status::ok) return status;
  const bool device = request.form == palpate_TraceRequest_1_0_FORM_DEVICE;
  if (request.count > kTipHistory || request.form > palpate_TraceRequest_1_0_FORM_DEVICE ||
      request.ticks == 0 || request.ticks > wire::kMaxTraceTicks || (device && request.count != 0))
    return Status::payload_malformed;
  if (request.count > 0 && request_count_ == requests_.size()) return Status::command_refused;
  if (request.count > 0) requests_[request_count_++] = {request.first_tick, request.count};
  if (device && trace_form_ != request.form) {
    for (DeviceSample stale; mailbox_.device.pop(stale);) {
    }
    next_device_tick_ = servo_.next_tick();
  }
  trace_form_ = request.form;
  trace_ticks_ = request.ticks;
  mailbox_.device_wanted.store(device, std::memory_order_relaxed);
  return Status::ok;
}

Status Endpoint::take_direct_force(const wire::Frame& frame) {
  palpate_DirectForce_1_0 message;
  if (const Status status = wire::deserialize(frame.payload, message); status != Status::ok) return status;
  const Vec3f force_N{message.force_N[0], message.force_N[1], message.force_N[2]};
  if (!is_finite(force_N)) return Status::payload_malformed;
  // Two programs at once: the one that armed is obeyed.
  if (frame.header.source != mailbox_.armed_node.load(std::memory_order_relaxed))
    return Status::command_refused;
  return mailbox_.direct_forces.push(force_N) ? Status::ok : Status::command_refused;
}

void Endpoint::note(const ModelReport& report) {
  if (report.status == Status::ok) {
    ++counters_.models_taken;
  } else {
    ++counters_.models_refused;
    counters_.last_status = report.status;
  }
  palpate_ModelReport_1_0 message{};
  message.sequence = report.sequence;
  message.status = static_cast<std::uint8_t>(report.status);
  message.model_tick = report.model_tick;
  message.swap_tick = report.swap_tick;
  message.correction_energy_J = report.correction_energy_J;
  (void)send(message, publication<palpate_ModelReport_1_0>(report_transfers_));
}

void Endpoint::send_model_reports() {
  ModelReport report;
  while (renderer_.next_report(report)) note(report);
  BasisStore::Event event;
  while (renderer_.next_basis_event(event)) note(event);
}

void Endpoint::note(const BasisStore::Event& event) {
  if (event.status != Status::ok) counters_.last_status = event.status;
  const BasisStore& bases = renderer_.bases();
  palpate_BasisReport_1_0 message{};
  message.basis_id = event.id;
  message.status = static_cast<std::uint8_t>(event.status);
  BasisStore::Blocks missing;
  message.basis_bytes = static_cast<std::uint32_t>(bases.missing(event.id, missing));
  if (event.status != Status::ok && message.basis_bytes != 0) {
    message.missing.count = missing.size();
    std::copy(missing.begin(), missing.end(), message.missing.elements);
  }
  static_assert(kBasisSlots <= palpate_BasisReport_1_0_held_ARRAY_CAPACITY_);
  for (std::uint32_t slot = 0; slot < kBasisSlots; ++slot)
    if (const std::uint32_t id = bases.held(slot); id != 0) message.held.elements[message.held.count++] = id;
  (void)send(message, publication<palpate_BasisReport_1_0>(basis_transfers_));
}

void Endpoint::send_replies() {
  CommandReply reply;
  while (mailbox_.replies.pop(reply)) {
    if (reply.outcome.status != Status::ok) counters_.last_status = reply.outcome.status;
    palpate_Command_Response_1_0 message{};
    message.status = static_cast<std::uint8_t>(reply.outcome.status);
    message.mode = static_cast<std::uint8_t>(reply.mode);
    message._token = reply.outcome.token;
    (void)send(message, response<palpate_Command_Response_1_0>(reply.requester));
  }
}

void Endpoint::send_urgent_replies() {
  const std::uint32_t asked =
      mailbox_.stops.load(std::memory_order_relaxed) + mailbox_.disarms.load(std::memory_order_relaxed);
  if (urgent_count_ == 0 || mailbox_.urgent_done.load(std::memory_order_acquire) != asked) return;
  palpate_Command_Response_1_0 message{};
  message.status = static_cast<std::uint8_t>(Status::ok);
  message.mode = static_cast<std::uint8_t>(mailbox_.urgent_mode.load(std::memory_order_relaxed));
  for (std::size_t i = 0; i < urgent_count_; ++i)
    (void)send(message, response<palpate_Command_Response_1_0>(urgent_[i]));
  urgent_count_ = 0;
}

void Endpoint::send_status() {
  StatusSnapshot snapshot;
  while (mailbox_.status.pop(snapshot)) {
    mode_ = snapshot.mode;
    faults_ = snapshot.faults;
    const wire::ReceiverCounters& received = framing_.counters();
    palpate_BoardStatus_1_0 message{};
    message.sequence = status_sequence_++;
    message.schema_hash = wire::kSchemaHash;
    message.tick = snapshot.tick;
    message.mode = static_cast<std::uint8_t>(snapshot.mode);
    message.last_status = static_cast<std::uint8_t>(counters_.last_status);
    message.faults = snapshot.faults;
    message._token = snapshot.token;
    message.models_taken = counters_.models_taken;
    message.models_refused = counters_.models_refused;
    message.frames_received = received.frames;
    message.frames_refused = received.refused() + counters_.frames_refused;
    message.frames_lost = transfers_.lost();
    message.frames_unsent = counters_.frames_unsent + link_.frames_unsent;
    message.missed_deadlines = snapshot.missed_deadlines;
    message.worst_tick_count = snapshot.worst_tick_count;
    message.clock_Hz = clock_Hz_;
    message.trace_form = trace_form_;
    message.trace_ticks = trace_ticks_;
    (void)send(message, publication<palpate_BoardStatus_1_0>(status_transfers_));
  }
}

void Endpoint::send_heartbeat() {
  constexpr std::uint32_t kPeriod_ticks = wire::kHeartbeatPeriod_s * kServoRate_Hz;
  const std::uint32_t due_tick = static_cast<std::uint32_t>(heartbeat_transfers_) * kPeriod_ticks;
  if (static_cast<std::int32_t>(servo_.next_tick() - due_tick) < 0) return;
  constexpr std::uint64_t kLongest_s = std::numeric_limits<std::uint32_t>::max();
  const wire::Heartbeat message{
      .uptime_s = static_cast<std::uint32_t>(std::min(heartbeat_transfers_, kLongest_s)),
      .health = health_of(faults_),
      .mode = node_mode_of(mode_),
      // The number of the first fault, from 1.
      .vendor_status = static_cast<std::uint8_t>(faults_ == 0 ? 0 : std::countr_zero(faults_) + 1)};
  (void)send(message, publication<wire::Heartbeat>(heartbeat_transfers_));
}

// What is handed to the link now goes out with the next tick, if the link is idle; what waits there delays
// it.
void Endpoint::send_time() {
  static_assert(1000 * kServoRate_Hz == 1'000'000);
  constexpr std::uint64_t kTick_us = 1000;
  constexpr std::uint32_t kTicks_ms = kServoRate_Hz / 1000;
  const std::uint32_t tick = servo_.next_tick();
  if (node_seen_ && tick - node_seen_tick_ > wire::kNodeTimeout_s * kServoRate_Hz) node_seen_ = false;
  if (!node_seen_) return;
  const std::uint32_t since = tick - time_tick_;
  if (time_tick_ != 0 && since < wire::kTimePeriod_ms * kTicks_ms) return;
  const bool follows = time_tick_ != 0 && since <= wire::kMaxTimePeriod_ms * kTicks_ms;
  wire::FrameHeader header = publication<wire::TimeSynchronization>(time_transfers_);
  header.priority = wire::Priority::fast;
  const bool sent = send(wire::TimeSynchronization{follows ? kTick_us * time_tick_ : 0}, header);
  time_tick_ = sent ? tick : 0;
}

std::uint32_t Endpoint::send_trace(std::uint32_t first_tick, std::uint32_t count) {
  return trace_form_ == palpate_TraceRequest_1_0_FORM_TIP ? send_tip_trace(first_tick, count)
                                                          : send_full_trace(first_tick, count);
}

std::uint32_t Endpoint::send_full_trace(std::uint32_t first_tick, std::uint32_t count) {
  std::uint32_t held = 0;
  trace_.first_tick = first_tick;
  for (ServoSample sample; held < count && servo_.sample(first_tick + held, sample); ++held) {
    trace_.samples.elements[held] = to_message(sample);
  }
  if (held == 0) return 0;
  trace_.samples.count = held;
  trace_.sequence = trace_sequence_++;
  (void)send(trace_, publication<palpate_ServoTrace_1_0>(trace_transfers_));
  return held;
}

std::uint32_t Endpoint::send_tip_trace(std::uint32_t first_tick, std::uint32_t count) {
  std::array<Vec3f, wire::kMaxTraceTicks> tip_m;
  std::uint32_t held = 0;
  for (ServoSample sample; held < count && servo_.sample(first_tick + held, sample); ++held)
    tip_m[held] = sample.tip_m;
  if (held == 0) return 0;
  tip_trace_.first_tick = first_tick;
  if (wire::write_tips(std::span(tip_m).first(held), tip_trace_) == Status::ok) {
    (void)send(tip_trace_, publication<palpate_TipTrace_1_0>(tip_transfers_));
  } else {
    ++counters_.frames_unsent;  // a path that no arm takes: the host will miss its ticks
  }
  return held;
}

void Endpoint::send_device_state() {
  DeviceSample sample;
  bool any = false;
  while (mailbox_.device.pop(sample)) any = true;
  if (!any || static_cast<std::int32_t>(sample.tick - next_device_tick_) < 0) return;
  next_device_tick_ = sample.tick + trace_ticks_;
  palpate_DeviceState_1_0 message{};
  message.tick = sample.tick;
  for (std::size_t i = 0; i < 3; ++i) {
    message.tip_m[i] = sample.tip_m[i];
    message.velocity_m_s[i] = sample.velocity_m_s[i];
    message.force_N[i] = -sample.force_N[i];  // the body's to the hand's
  }
  message.mode = static_cast<std::uint8_t>(sample.mode);
  message.flags = sample.flags;
  message.faults = sample.faults;
  (void)send(message, publication<palpate_DeviceState_1_0>(device_transfers_));
}

void Endpoint::send_traces() {
  if (trace_form_ == palpate_TraceRequest_1_0_FORM_DEVICE) {
    next_trace_tick_ = servo_.next_tick();  // whoever wants ticks again gets those to come
    send_device_state();
    return;
  }
  for (std::uint32_t i = 0; i < kTracesPerRun; ++i) {
    const std::uint32_t ready = servo_.next_tick() - next_trace_tick_;
    if (ready < trace_ticks_) return;
    // What the history no longer holds is lost to the trace; half a history ahead is safely held.
    if (ready >= kTipHistory - trace_ticks_) next_trace_tick_ += ready - kTipHistory / 2;
    (void)send_trace(next_trace_tick_, trace_ticks_);
    next_trace_tick_ += trace_ticks_;
  }
}

void Endpoint::resend_traces() {
  if (request_count_ == 0) return;
  constexpr std::uint32_t kMostTicks = wire::kMaxTraceTicks;
  if (link_.transmit.free() < LinkFraming::kLargestSent + kResendReserve) return;
  TickRange& request = requests_.front();
  // Ticks that have not happened, or are forgotten, are passed over: the request says "as far as the history
  // reaches".
  ServoSample sample;
  while (request.count > 0 && !servo_.sample(request.first_tick, sample)) {
    ++request.first_tick;
    --request.count;
  }
  const std::uint32_t sent = send_trace(request.first_tick, std::min(request.count, kMostTicks));
  request.first_tick += sent;
  request.count -= sent;
  if (request.count == 0) {
    std::copy(requests_.begin() + 1, requests_.end(), requests_.begin());
    --request_count_;
  }
}

bool Endpoint::is_refused_from(std::uint16_t node) const {
  return mailbox_.is_armed.load(std::memory_order_relaxed) &&
         node != mailbox_.armed_node.load(std::memory_order_relaxed);
}

void Endpoint::note_model_of(std::uint16_t node) {
  const std::uint16_t before = mailbox_.model_node.load(std::memory_order_relaxed);
  if (before == node) return;
  // While it is armed the others' have been forgotten, and none comes.
  const bool alone = before == kNoNode || mailbox_.is_armed.load(std::memory_order_relaxed);
  mailbox_.model_node.store(alone ? node : kManyNodes, std::memory_order_relaxed);
}

void Endpoint::refuse(Status status) {
  ++counters_.frames_refused;
  counters_.last_status = status;
}

template <class Message>
bool Endpoint::send(const Message& message, const wire::FrameHeader& header) {
  std::size_t length = 0;
  if (wire::serialize(message, payload_, length) == Status::ok &&
      framing_.send(header, std::span(payload_).first(length), link_.transmit))
    return true;
  ++counters_.frames_unsent;
  return false;
}

template <class Message>
wire::FrameHeader Endpoint::publication(std::uint64_t& transfers) const {
  return {.priority = wire::Priority::nominal,
          .source = wire::kBoardNode,
          .destination = wire::kBroadcast,
          .specifier = wire::MessageTraits<Message>::kSpecifier,
          .transfer_id = transfers++};
}

template <class Response>
wire::FrameHeader Endpoint::response(const Requester& requester) const {
  return {.priority = wire::Priority::high,
          .source = wire::kBoardNode,
          .destination = requester.node,
          .specifier = wire::MessageTraits<Response>::kSpecifier,
          .transfer_id = requester.transfer_id};
}

}  // namespace palpate::firmware
