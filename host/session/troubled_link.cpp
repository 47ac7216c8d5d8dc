#include "host/session/troubled_link.hpp"

#include <cstddef>
#include <stdexcept>
#include <utility>

#include "firmware/core/supervisor.hpp"
#include "host/link/can_record_bytes.hpp"
#include "shared/wire/can_frame.hpp"

namespace palpate::host {
namespace {

constexpr std::uint16_t kOtherNode = 11;
// From one command, model and request to the next: three times as many models as the first host's.
constexpr std::uint32_t kOtherPeriod_ticks = 10;
constexpr float kOtherForce_N = 8.0f;
constexpr std::size_t kMostFlood = 64;  // frames in a tick
// Messages of node 99 that nobody here listens to, of Cyphal's nominal and of its first priority.
constexpr std::uint32_t kForeignMessage = 0x0060'0000u | (7000u << 8) | 99u;
constexpr std::uint32_t kFloodIdentifier = (4u << 26) | kForeignMessage, kBabbleIdentifier = kForeignMessage;

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

TroubledDirection::TroubledDirection(link::FramingKind framing, const std::vector<link::Fault>& planned,
                                     const std::vector<link::RandomFault>& random, std::uint32_t seed)
    : is_can_(framing != link::FramingKind::serial), serial_(planned) {
  if (is_can_ && !planned.empty())
    throw std::invalid_argument("faults of a link: planned for serial frames, on a link that is CAN");
  for (const link::RandomFault& fault : random) {
    if (is_can_) {
      can_.add(fault, seed++);
    } else {
      serial_.add(fault, seed++);
    }
  }
}

std::vector<std::uint8_t> TroubledDirection::apply(std::span<const std::uint8_t> bytes, std::uint32_t tick,
                                                   bool unplugged) {
  const std::uint64_t before = hit().sum();
  std::vector<std::uint8_t> left = pass(bytes, tick, unplugged);
  if (hit().sum() > before && (hit_ticks_.empty() || hit_ticks_.back() != tick)) hit_ticks_.push_back(tick);
  return left;
}

std::vector<std::uint8_t> TroubledDirection::pass(std::span<const std::uint8_t> bytes, std::uint32_t tick,
                                                  bool unplugged) {
  if (is_can_) return can_.apply(bytes, tick, unplugged);
  const std::uint64_t frames = serial_.frames_seen(), spoilt = serial_.frames_spoilt();
  std::vector<std::uint8_t> left = serial_.apply(bytes, tick);
  if (!unplugged) return left;
  kept_ += serial_.frames_seen() - frames - (serial_.frames_spoilt() - spoilt);
  return {};
}

TroubledLink::TroubledLink(link::Medium& down, link::Medium& up, const ClosedLoopConfig& config,
                           link::UsbHost* usb)
    : down_(down),
      up_(up),
      usb_(usb),
      troubles_(config.troubles),
      framing_(config.framing),
      faults_down_(framing_, config.faults_down, troubles_.random_down, 2 * troubles_.seed),
      faults_up_(framing_, config.faults_up, troubles_.random_up, 2 * troubles_.seed + 1),
      delay_down_(troubles_.delay_down, 3 * troubles_.seed),
      delay_up_(troubles_.delay_up, 3 * troubles_.seed + 1),
      other_({.node = kOtherNode, .framing = config.framing}) {
  if (!troubles_.babble.empty() && framing_ == link::FramingKind::serial)
    throw std::invalid_argument("faults of a link: a node babbles on CAN only");
  if (!troubles_.refused.empty() && usb_ == nullptr)
    throw std::invalid_argument("faults of a link: a device refuses on USB only");
  if (usb_ != nullptr &&
      !(config.faults_down.empty() && config.faults_up.empty() && troubles_.random_down.empty() &&
        troubles_.random_up.empty() && troubles_.second_host.empty() && troubles_.flood.empty()))
    throw std::invalid_argument(
        "faults of a link: a USB bus has one host, and repeats what an error has hit: no frame of it is "
        "lost, "
        "comes twice or overtakes");
}

bool TroubledLink::is_unplugged(std::uint32_t tick) const {
  return unplugged_ || contains(troubles_.unplugged, tick);
}

// A program cannot begin before there is a device to open.
bool TroubledLink::host_runs(std::uint32_t tick) const {
  return !contains(troubles_.host_stopped, tick) && (usb_ == nullptr || usb_->was_open());
}

void TroubledLink::send_up(std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  if (usb_ != nullptr) {
    (void)up_.submit(bytes, tick);
    return;
  }
  delay_up_.submit(faults_up_.apply(bytes, tick, is_unplugged(tick)), tick);
  delay_up_.deliver(tick, [&](const std::vector<std::uint8_t>& due) { (void)up_.submit(due, tick); });
}

void TroubledLink::send_down(std::span<const std::uint8_t> frame, std::uint32_t tick) {
  if (usb_ != nullptr) {
    delay_down_.submit({frame.begin(), frame.end()}, tick);
    return;
  }
  delay_down_.submit(faults_down_.apply(frame, tick, is_unplugged(tick)), tick);
}

std::vector<std::uint8_t> TroubledLink::to_host(std::uint32_t tick) {
  const auto wait = [this](const std::vector<std::uint8_t>& arrived) {
    waiting_.insert(waiting_.end(), arrived.begin(), arrived.end());
  };
  if (usb_ != nullptr) {
    delay_up_.submit(up_.deliver(tick), tick);
    delay_up_.deliver(tick, wait);
    usb_->set_plugged(!is_unplugged(tick), tick);
    usb_->set_program_runs(!contains(troubles_.host_stopped, tick));
    usb_->set_refused(contains(troubles_.refused, tick));
  } else {
    wait(up_.deliver(tick));
  }
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
    if (framing_ != link::FramingKind::serial) {
      add_foreign(left_bytes, kFloodIdentifier, frames);
      continue;
    }
    for (std::size_t i = 0; i < kMostFlood && left_bytes > 0.0; ++i) {
      frames.push_back(other_.encode(any_request()));
      left_bytes -= static_cast<double>(frames.back().bytes.size());
    }
  }
  if (babbling_ || contains(troubles_.babble, tick)) {
    // As many as go in a tick: there is always one that waits.
    babbled_bytes_ += down_.bytes_per_tick();
    const std::size_t before = frames.size();
    add_foreign(babbled_bytes_, kBabbleIdentifier, frames);
    for (std::size_t i = before; i < frames.size(); ++i)
      babbled_bytes_ -= static_cast<double>(frames[i].bytes.size());
  }
  foreign_ += frames.size();
  if (!is_unplugged(tick))
    for (const link::OutgoingFrame& frame : frames) (void)down_.submit(frame.bytes, tick);
  delay_down_.deliver(tick, [&](const std::vector<std::uint8_t>& due) { (void)down_.submit(due, tick); });
}

void TroubledLink::add_foreign(double bytes, std::uint32_t identifier,
                               std::vector<link::OutgoingFrame>& frames) const {
  const bool fd = framing_ == link::FramingKind::can_fd;
  std::vector<std::uint8_t> data(wire::can_mtu(fd ? wire::CanFormat::fd : wire::CanFormat::classic), 0x55);
  data.back() = wire::can_tail_byte({.start = true, .end = true, .toggle = true});
  const std::vector<std::uint8_t> record =
      link::can_record_of({.identifier = identifier, .fd = fd, .data = data});
  for (std::size_t i = 0; i < kMostFlood && bytes > 0.0; ++i) {
    frames.push_back({.bytes = record});
    bytes -= static_cast<double>(record.size());
  }
}

void TroubledLink::set_babbling(bool babbling) {
  if (framing_ == link::FramingKind::serial)
    throw std::invalid_argument("faults of a link: a node babbles on CAN only");
  babbling_ = babbling;
}

void TroubledLink::add_fault(bool to_board, const link::Fault& fault) {
  if (framing_ != link::FramingKind::serial && fault.kind == link::FaultKind::flip_bit) {
    (void)(to_board ? down_ : up_).fail_attempts(1);
    return;
  }
  (to_board ? faults_down_ : faults_up_).add(fault);
}

TroubleCounters TroubledLink::counters() const {
  const auto of = [](const TroubledDirection& faults, const link::DelayLine& delay) {
    return DirectionTroubles{
        .frames = faults.frames(), .hit = faults.hit(), .delayed = delay.delayed(), .cut = faults.cut()};
  };
  return {.down = of(faults_down_, delay_down_),
          .up = of(faults_up_, delay_up_),
          .frames_removed_down = faults_down_.removed() + (usb_ == nullptr ? 0 : usb_->frames_unsent()),
          .frames_removed_up = faults_up_.removed(),
          .foreign_frames = foreign_};
}

}  // namespace palpate::host
