#include "host/session/troubled_link.hpp"

#include <cstddef>
#include <utility>

#include "firmware/core/supervisor.hpp"

namespace palpate::host {
namespace {

constexpr std::uint16_t kOtherNode = 11;
// From one command, model and request to the next: three times as many models as the first host's.
constexpr std::uint32_t kOtherPeriod_ticks = 10;
constexpr float kOtherForce_N = 8.0f;
constexpr std::size_t kMostFlood = 64;  // frames in a tick

link::FaultPlan plan(const std::vector<link::Fault>& faults, const std::vector<link::RandomFault>& random,
                     std::uint32_t seed) {
  link::FaultPlan plan(faults);
  for (const link::RandomFault& fault : random) plan.add(fault, seed++);
  return plan;
}

palpate_TraceRequest_1_0 any_request() {
  palpate_TraceRequest_1_0 request{};
  request.form = palpate_TraceRequest_1_0_FORM_TIP;
  request.ticks = 8;
  return request;
}

palpate_ModelState_1_0 any_model(std::uint32_t tick) {
  palpate_ModelState_1_0 state{};
  state.sequence = tick;
  state.schema_hash = wire::kSchemaHash;
  state.tick = tick > 0 ? tick - 1 : 0;
  state.valid_ticks = 1000;
  state.kind = palpate_ModelState_1_0_KIND_HELD_FORCE;
  state.contact.force_N[2] = -kOtherForce_N;
  return state;
}

}  // namespace

TroubledLink::TroubledLink(link::Medium& down, link::Medium& up, const ClosedLoopConfig& config)
    : down_(down),
      up_(up),
      troubles_(config.troubles),
      faults_down_(plan(config.faults_down, troubles_.random_down, 2 * troubles_.seed)),
      faults_up_(plan(config.faults_up, troubles_.random_up, 2 * troubles_.seed + 1)),
      delay_down_(troubles_.delay_down, 3 * troubles_.seed),
      delay_up_(troubles_.delay_up, 3 * troubles_.seed + 1),
      other_({.node = kOtherNode, .framing = config.framing}) {}

bool TroubledLink::is_unplugged(std::uint32_t tick) const {
  return unplugged_ || contains(troubles_.unplugged, tick);
}

bool TroubledLink::host_runs(std::uint32_t tick) const {
  return !contains(troubles_.host_stopped, tick);
}

void TroubledLink::send_up(std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  const std::uint64_t frames = faults_up_.frames_seen(), spoilt = faults_up_.frames_spoilt();
  std::vector<std::uint8_t> left = faults_up_.apply(bytes, tick);
  if (is_unplugged(tick)) {
    kept_up_ += faults_up_.frames_seen() - frames - (faults_up_.frames_spoilt() - spoilt);
    left.clear();
  }
  delay_up_.submit(std::move(left), tick);
  delay_up_.deliver(tick, [&](const std::vector<std::uint8_t>& due) { (void)up_.submit(due, tick); });
}

void TroubledLink::send_down(std::span<const std::uint8_t> frame, std::uint32_t tick) {
  const std::uint64_t frames = faults_down_.frames_seen(), spoilt = faults_down_.frames_spoilt();
  std::vector<std::uint8_t> left = faults_down_.apply(frame, tick);
  if (is_unplugged(tick)) {
    kept_down_ += faults_down_.frames_seen() - frames - (faults_down_.frames_spoilt() - spoilt);
    left.clear();
  }
  delay_down_.submit(std::move(left), tick);
}

std::vector<std::uint8_t> TroubledLink::to_host(std::uint32_t tick) {
  const std::vector<std::uint8_t> arrived = up_.deliver(tick);
  waiting_.insert(waiting_.end(), arrived.begin(), arrived.end());
  if (!host_runs(tick)) return {};
  return std::exchange(waiting_, {});
}

void TroubledLink::send_of_others(std::uint32_t tick) {
  std::vector<link::OutgoingFrame> frames;
  if (contains(troubles_.second_host, tick) && tick % kOtherPeriod_ticks == 0) {
    // Neither what everybody may: STOP and DISARM.
    constexpr std::uint8_t kActions[] = {
        palpate_Command_Request_1_0_ARM_REQUEST, palpate_Command_Request_1_0_ARM_CONFIRM,
        palpate_Command_Request_1_0_CALIBRATE, palpate_Command_Request_1_0_CLEAR_FAULT};
    palpate_Command_Request_1_0 command{};
    command.action = kActions[tick / kOtherPeriod_ticks % std::size(kActions)];
    frames.push_back(other_.encode(command));
    frames.push_back(other_.encode(any_model(tick)));
    frames.push_back(other_.encode(any_request()));
  }
  for (const LinkTroubles::Flood& flood : troubles_.flood) {
    if (tick < flood.span.first_tick || tick >= flood.span.end_tick) continue;
    double left_bytes = flood.load * down_.bytes_per_tick();
    for (std::size_t i = 0; i < kMostFlood && left_bytes > 0.0; ++i) {
      frames.push_back(other_.encode(any_request()));
      left_bytes -= static_cast<double>(frames.back().bytes.size());
    }
  }
  foreign_ += frames.size();
  if (!is_unplugged(tick))
    for (const link::OutgoingFrame& frame : frames) (void)down_.submit(frame.bytes, tick);
  delay_down_.deliver(tick, [&](const std::vector<std::uint8_t>& due) { (void)down_.submit(due, tick); });
}

void TroubledLink::add_fault(bool to_board, const link::Fault& fault) {
  (void)(to_board ? faults_down_ : faults_up_).add(fault);
}

TroubleCounters TroubledLink::counters() const {
  return {.frames_removed_down = faults_down_.frames_spoilt() + kept_down_,
          .frames_removed_up = faults_up_.frames_spoilt() + kept_up_,
          .foreign_frames = foreign_};
}

}  // namespace palpate::host
