#include "host/bench/link_cost.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <stdexcept>

#include "boards/lockstep/exchange.hpp"
#include "host/link/host_endpoint.hpp"
#include "host/link/usb_ideal_device.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::host::bench {
namespace {

using Bytes = std::vector<std::uint8_t>;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double processor_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Of the default, builder hybrid with 72 modes and 32 nodes (docs/protocol.md).
palpate_ModelState_1_0 usual_state() {
  palpate_ModelState_1_0 state{};
  state.schema_hash = wire::kSchemaHash;
  state.displacement.count = 3 * 32;
  state.q.count = state.p.count = 72;
  for (std::size_t i = 0; i < 72; ++i)
    state.q.elements[i] = state.p.elements[i] = static_cast<std::int16_t>(37 * i);
  return state;
}

palpate_ModelState_1_0 largest_state() {
  palpate_ModelState_1_0 state = usual_state();
  state.load.count = state.q.count = state.p.count = palpate_ModelState_1_0_q_ARRAY_CAPACITY_;
  return state;
}

// Such that on classic CAN, too, it has room in a tick of the lock-step exchange.
palpate_ModelPart_1_0 usual_part() {
  palpate_ModelPart_1_0 part{};
  part.basis_id = 7;
  part.basis_bytes = 16'900;
  part.data.count = 2 * palpate_ModelPart_1_0_BLOCK_BYTES;
  for (std::size_t i = 0; i < part.data.count; ++i)
    part.data.elements[i] = static_cast<std::uint8_t>(101 * i + 1);
  return part;
}

palpate_ServoTrace_1_0 usual_trace() {
  palpate_ServoTrace_1_0 trace{};
  trace.samples.count = 4;
  for (std::size_t i = 0; i < 4; ++i)
    for (float& coordinate : trace.samples.elements[i].tip_m) coordinate = 0.01f * static_cast<float>(i + 1);
  return trace;
}

palpate_TipTrace_1_0 usual_tips() {
  palpate_TipTrace_1_0 trace{};
  trace.step_exponent = -20;
  trace.offsets.count = 3;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::int16_t& step : trace.offsets.elements[i].steps) step = static_cast<std::int16_t>(1000 * i + 7);
  return trace;
}

template <class Message>
Bytes payload_of(const Message& message) {
  Bytes payload(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  if (wire::serialize(message, payload, length) != Status::ok)
    throw std::logic_error("link cost: a message cannot be serialized");
  payload.resize(length);
  return payload;
}

// As the board sends it: from its node, each one a new transfer.
template <class Message>
Bytes from_board(const link::Framing& framing, const Message& message, std::uint64_t transfer_id) {
  return framing.encode({.source = wire::kBoardNode,
                         .specifier = wire::MessageTraits<Message>::kSpecifier,
                         .transfer_id = transfer_id},
                        payload_of(message));
}

constexpr std::size_t kBlock = 64;  // messages between two looks at the clock

void time_in_turn(HostMessageCost& cost, std::uint32_t rounds, const std::function<void(std::size_t)>& work) {
  const Bytes source(cost.link_bytes, 0x5A);
  Bytes target(cost.link_bytes);
  std::vector<double> work_s, copy_s;
  for (std::uint32_t round = 0; round < rounds; ++round) {
    double began_s = processor_s();
    for (std::size_t i = 0; i < kBlock; ++i) work(i);
    work_s.push_back((processor_s() - began_s) / kBlock);
    began_s = processor_s();
    for (std::size_t i = 0; i < kBlock; ++i) {
      std::memcpy(target.data(), source.data(), source.size());
      asm volatile("" : : "r"(target.data()) : "memory");  // it is a copy that somebody wants
    }
    copy_s.push_back((processor_s() - began_s) / kBlock);
  }
  cost.seconds = median(std::move(work_s));
  cost.copy_seconds = median(std::move(copy_s));
}

template <class Message>
HostMessageCost encoding(const char* name, const Message& message, link::FramingKind framing,
                         std::uint32_t rounds) {
  link::HostEndpoint endpoint({.framing = framing});
  HostMessageCost cost{.message = name,
                       .message_bytes = wire::payload_bytes(message),
                       .link_bytes = endpoint.encode(message).bytes.size(),
                       .to_board = true};
  time_in_turn(cost, rounds, [&](std::size_t) { (void)endpoint.encode(message); });
  return cost;
}

template <class Message>
HostMessageCost decoding(const char* name, const Message& message, link::FramingKind kind,
                         std::uint32_t rounds) {
  link::HostEndpoint endpoint({.framing = kind});
  const auto framing = link::make_framing(kind);
  // So many that none is taken for a copy of the one before, on CAN neither.
  std::vector<Bytes> transfers;
  transfers.reserve(kBlock);
  for (std::size_t i = 0; i < kBlock; ++i) transfers.push_back(from_board(*framing, message, i));
  HostMessageCost cost{.message = name,
                       .message_bytes = wire::payload_bytes(message),
                       .link_bytes = transfers[0].size(),
                       .to_board = false};
  std::size_t heard = 0;
  time_in_turn(cost, rounds, [&](std::size_t i) { heard += endpoint.receive(transfers[i], 0).size(); });
  if (heard != kBlock * rounds) throw std::logic_error("link cost: the endpoint refused a message");
  return cost;
}

}  // namespace

MediumLimit measure_medium_limit(const link::MeteredLinkOptions& options, std::uint32_t ticks) {
  const auto link = link::make_metered_link(options);
  link::HostEndpoint endpoint({.framing = link::framing_of(options.medium)});
  const palpate_ModelState_1_0 message = largest_state();
  const std::size_t frame_bytes = endpoint.encode(message).bytes.size();
  std::size_t arrived = 0;
  // Of USB the device that takes all: the bus is the limit, and what it takes to begin is not counted.
  link::UsbIdealDevice device;
  std::uint32_t first = 0;
  link::UsbHost* const usb = link->usb_host();
  while (usb != nullptr && !usb->is_open()) {
    (void)link->up().submit(device.tick(link->down().deliver(first)), first);
    ++first;
    (void)link->up().deliver(first);
  }
  for (std::uint32_t tick = first; tick <= first + ticks; ++tick) {
    const Bytes brought = link->down().deliver(tick);
    if (usb != nullptr) {
      (void)link->up().submit(device.tick(brought), tick);
      arrived = device.heard().size();
    } else {
      arrived += brought.size();
    }
    // Two ticks' worth and a message wait: the medium never runs dry.
    while (static_cast<double>(link->down().backlog_bytes(tick)) <
           2.0 * link->down().bytes_per_tick() + static_cast<double>(frame_bytes))
      (void)link->down().submit(endpoint.encode(message).bytes, tick);
  }
  const double duration_s = static_cast<double>(ticks) / link::kTicksPerSecond;
  const double messages = static_cast<double>(arrived) / static_cast<double>(frame_bytes);
  return {.message_bytes_per_s = messages * static_cast<double>(wire::payload_bytes(message)) / duration_s,
          .link_bytes_per_s = static_cast<double>(arrived) / duration_s,
          .busy_share = link->down().counters().busy_ticks / static_cast<double>(ticks)};
}

std::vector<HostMessageCost> measure_host_cost(link::FramingKind framing, std::uint32_t rounds) {
  if (rounds == 0) throw std::invalid_argument("link cost: rounds = 0: must be at least 1");
  return {encoding("ModelState, 72 modes, 32 nodes", usual_state(), framing, rounds),
          encoding("ModelPart, 512 bytes", usual_part(), framing, rounds),
          decoding("ServoTrace, 4 ticks", usual_trace(), framing, rounds),
          decoding("TipTrace, 4 ticks", usual_tips(), framing, rounds)};
}

namespace {

// A board that is idle, tick by tick; nothing is simulated around it.
class IdleBoard {
 public:
  IdleBoard(LockstepPeer& peer, link::FramingKind framing) : peer_(peer), endpoint_({.framing = framing}) {}

  // Clock counts of the tick before and of the background that ended in it.
  std::uint32_t tick(const Bytes& link_bytes = {}, std::uint32_t flags = 0) {
    lockstep::SensorFrame sensors{};
    if (link_bytes.size() > sensors.link.size()) throw std::logic_error("link cost: too much for a tick");
    sensors.magic = lockstep::kSensorMagic;
    sensors.tick = next_tick_;
    sensors.flags = flags;
    sensors.link_length = static_cast<std::uint32_t>(link_bytes.size());
    std::copy(link_bytes.begin(), link_bytes.end(), sensors.link.begin());
    peer_.send(sensors);
    lockstep::ActuatorFrame actuators{};
    peer_.receive(actuators);
    next_tick_ = actuators.next_tick;
    sent_bytes_ = actuators.link_length;
    if (actuators.clock_Hz == 0) throw std::runtime_error("link cost: this board has no clock");
    return actuators.busy_count;
  }
  [[nodiscard]] std::uint32_t next_tick() const { return next_tick_; }
  // Of the tick that was run last.
  [[nodiscard]] std::uint32_t sent_bytes() const { return sent_bytes_; }
  link::HostEndpoint& endpoint() { return endpoint_; }
  void shut_down() { (void)tick({}, lockstep::kShutdown); }

 private:
  LockstepPeer& peer_;
  link::HostEndpoint endpoint_;
  std::uint32_t next_tick_ = 0, sent_bytes_ = 0;
};

constexpr std::uint32_t kTicksPerTrace = 4, kTicksPerStatus = 100, kSettling_ticks = 40;

// A message in a tick in which the board sends nothing, against that tick of the next trace without one.
template <class Message>
BoardMessageCost receiving(const char* name, const Message& message, IdleBoard& board, std::uint32_t rounds) {
  std::vector<double> counts;
  std::size_t link_bytes = 0;
  while (counts.size() < rounds) {
    while (board.next_tick() % kTicksPerTrace != 1 || board.next_tick() % kTicksPerStatus > 80)
      (void)board.tick();
    const Bytes frame = board.endpoint().encode(message).bytes;
    link_bytes = frame.size();
    (void)board.tick(frame);
    const double with = board.tick();
    while (board.next_tick() % kTicksPerTrace != 1) (void)board.tick();
    (void)board.tick();
    counts.push_back(with - static_cast<double>(board.tick()));
  }
  return {.message = name,
          .message_bytes = wire::payload_bytes(message),
          .link_bytes = link_bytes,
          .to_board = true,
          .clock_counts = median(std::move(counts))};
}

// What the board sends by itself, against the tick after it.
BoardMessageCost sending(const char* name, std::size_t message_bytes, IdleBoard& board,
                         std::uint32_t rounds) {
  std::vector<double> counts;
  std::size_t link_bytes = 0;
  for (std::uint32_t round = 0; round < rounds; ++round) {
    while (board.next_tick() % kTicksPerStatus < 8 || board.next_tick() % kTicksPerStatus > 80)
      (void)board.tick();
    // Its bytes leave in the tick after the background that has encoded them, whose length that tick tells.
    double busy = board.tick();
    while (board.sent_bytes() == 0) busy = board.tick();
    link_bytes = board.sent_bytes();
    counts.push_back(busy - static_cast<double>(board.tick()));
  }
  return {.message = name,
          .message_bytes = message_bytes,
          .link_bytes = link_bytes,
          .to_board = false,
          .clock_counts = median(std::move(counts))};
}

}  // namespace

std::vector<BoardMessageCost> measure_board_cost(LockstepPeer& peer, link::FramingKind framing,
                                                 std::uint32_t rounds) {
  if (rounds == 0) throw std::invalid_argument("link cost: rounds = 0: must be at least 1");
  IdleBoard board(peer, framing);
  for (std::uint32_t i = 0; i < kSettling_ticks; ++i) (void)board.tick();
  std::vector<BoardMessageCost> costs;
  costs.push_back(sending("ServoTrace, 4 ticks", wire::payload_bytes(usual_trace()), board, rounds));
  costs.push_back(receiving("ModelPart, 512 bytes", usual_part(), board, rounds));
  costs.push_back(
      receiving("ModelState, 72 modes, 32 nodes, its basis missing", usual_state(), board, rounds));
  costs.push_back(receiving("DirectForce, refused", palpate_DirectForce_1_0{}, board, rounds));
  palpate_TraceRequest_1_0 tips{};
  tips.form = palpate_TraceRequest_1_0_FORM_TIP;
  tips.ticks = kTicksPerTrace;
  (void)board.tick(board.endpoint().encode(tips).bytes);
  for (std::uint32_t i = 0; i < kSettling_ticks; ++i) (void)board.tick();
  costs.push_back(sending("TipTrace, 4 ticks", wire::payload_bytes(usual_tips()), board, rounds));
  board.shut_down();
  return costs;
}

}  // namespace palpate::host::bench
