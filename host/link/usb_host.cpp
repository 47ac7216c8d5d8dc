#include "host/link/usb_host.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::link {
namespace {

constexpr std::uint32_t kDebounce_ticks = 100, kReset_ticks = 10, kRecovery_ticks = 10;
constexpr std::size_t kTries = 3;
constexpr std::size_t kEager = 8, kLazy = 2;  // questions a frame
// Transfers that the driver has buffers for when the program does nothing (host/link/usb_link.cpp).
constexpr std::size_t kInBuffers = 4;
// Records that are not answered: those of two frames, for which the board's wires have room.
constexpr std::size_t kMostAskedBytes = 2700;

[[noreturn]] void refuse(const char* what) {
  throw std::runtime_error(std::string("board: on its USB bus ") + what);
}

}  // namespace

UsbHost::UsbHost(std::size_t queue_limit_bytes, BusErrors errors)
    : queue_limit_bytes_(queue_limit_bytes), errors_(std::move(errors)) {
  if (queue_limit_bytes == 0)
    throw std::invalid_argument("UsbHost: queue_limit_bytes is 0; at least 1 is needed");
  check_bus_errors(errors_, "UsbHost");
}

bool UsbHost::is_hit(std::size_t direction, std::uint32_t tick) {
  double passes = 1.0;
  for (const BusError& error : errors_.errors)
    if (error.direction == direction && tick >= error.first_tick && tick < error.end_tick)
      passes *= 1.0 - error.chance;
  return passes < 1.0 && drawn(errors_.seed, draws_++) >= passes;
}

void UsbHost::settle(std::uint32_t tick, std::uint32_t ticks) {
  phase_ = Phase::settling;
  due_tick_ = tick + ticks;
}

void UsbHost::close() {
  frames_unsent_ += out_.frames();
  // Bytes of a transfer that the device's going has ended are still the program's.
  in_.complete();
  if (std::vector<std::uint8_t> rest = in_.completed(); !rest.empty())
    received_.emplace_back(tick_, std::move(rest));
  out_ = {};
  in_ = {};
  for (Asked& asked : asked_) asked.kind = Asked::Kind::nobodys;
}

void UsbHost::set_plugged(bool plugged, std::uint32_t tick) {
  advance(tick);
  if (plugged == is_plugged_) return;
  is_plugged_ = plugged;
  phase_ = Phase::none;
  if (!plugged) {
    if (is_attached_) append_usb_record(records_, UsbRecord::unplug);
  } else if (is_attached_) {
    tries_ = 0;
    settle(tick, kDebounce_ticks);
  }
}

void UsbHost::advance(std::uint32_t tick) {
  if (tick < tick_)
    throw std::invalid_argument("UsbHost: tick " + std::to_string(tick) + " comes after tick " +
                                std::to_string(tick_) + "; ticks must not decrease");
  if (tick == tick_) return;
  tick_ = tick;
  plan(tick);
}

// The frame that ends with this tick: what has been handed over before it.
void UsbHost::plan(std::uint32_t tick) {
  // With the cable out what is on its way is answered first, for it has crossed.
  if (!is_plugged_ && asked_.empty()) close();
  if (!is_plugged_ || !is_attached_) return;
  if (phase_ == Phase::settling && tick >= due_tick_) {
    close();
    append_usb_record(records_, UsbRecord::reset);
    phase_ = Phase::resetting;
    due_tick_ = tick + kReset_ticks + kRecovery_ticks;
    ++tries_;
  }
  if (phase_ == Phase::resetting && tick >= due_tick_) {
    phase_ = Phase::enumerating;
    enumeration_ = {};
  }
  append_usb_record(records_, UsbRecord::frame);
  if (phase_ == Phase::enumerating) plan_control(tick);
  if (phase_ == Phase::open && !is_refused_) plan_bulk(tick);
}

void UsbHost::plan_control(std::uint32_t tick) {
  if (const std::optional<UsbEnumeration::Token> token = enumeration_.next(tick)) {
    const std::size_t before = records_.size();
    append_usb_record(records_, token->kind, token->address, token->data);
    const auto address = static_cast<std::uint8_t>(token->address & ~lockstep::kUsbAgain);
    ask({.kind = Asked::Kind::control, .address = address}, before);
  }
  if (enumeration_.state() == UsbEnumeration::State::failed) {
    if (tries_ < kTries) {
      settle(tick, 0);
    } else {
      phase_ = Phase::failed;
    }
  }
}

void UsbHost::ask(const Asked& asked, std::size_t records_before) {
  asked_.push_back(asked);
  asked_.back().record_bytes = records_.size() - records_before;
  asked_bytes_ += asked_.back().record_bytes;
}

void UsbHost::plan_bulk(std::uint32_t tick) {
  constexpr std::uint64_t kFrame = kUsbFrameBytes - kUsbStartOfFrameBytes;
  const std::uint64_t paid = std::min(debt_, kFrame);
  debt_ -= paid;
  std::uint64_t left = kFrame - paid;
  if (program_runs_) in_buffers_ = kInBuffers;
  std::size_t questions = in_buffers_ == 0 ? 0 : std::exchange(had_data_, false) ? kEager : kLazy;
  for (bool goes_on = true; goes_on;) {
    goes_on = questions != 0 && plan_in(tick, left);
    if (goes_on) --questions;
    goes_on = plan_out(tick, left) || goes_on;
  }
}

bool UsbHost::plan_out(std::uint32_t tick, std::uint64_t& left) {
  if (!out_.has_packet() || asked_bytes_ + lockstep::kUsbRecordBytes > kMostAskedBytes) return false;
  const std::uint64_t duration = kUsbTransactionOverheadBytes + out_.packet_bytes();
  if (duration > left) return false;
  left -= duration;
  if (is_hit(0, tick)) {  // the device sees none
    ++sides_[0].attempts_failed;
    return true;
  }
  const bool is_answered = !is_hit(1, tick);
  if (!is_answered) ++sides_[1].attempts_failed;
  const std::size_t before = records_.size();
  out_.append_packet(records_, enumeration_.pipes().out, is_answered);
  ask({.kind = Asked::Kind::out, .is_taken = is_answered, .address = enumeration_.pipes().out}, before);
  return true;
}

bool UsbHost::plan_in(std::uint32_t tick, std::uint64_t& left) {
  if (kUsbRefusedInBytes > left || asked_bytes_ + lockstep::kUsbRecordBytes > kMostAskedBytes) return false;
  left -= kUsbRefusedInBytes;
  if (is_hit(0, tick)) {  // the token
    ++sides_[0].attempts_failed;
    return true;
  }
  const bool is_taken = !is_hit(1, tick);
  const bool is_acknowledged = is_taken && !is_hit(0, tick);
  const std::uint8_t address = enumeration_.pipes().in;
  const std::size_t before = records_.size();
  append_usb_record(records_, UsbRecord::in,
                    static_cast<std::uint8_t>(address | (is_acknowledged ? 0 : lockstep::kUsbUnheard)));
  ask({.kind = Asked::Kind::in, .is_taken = is_taken, .is_acknowledged = is_acknowledged, .address = address},
      before);
  return true;
}

void UsbHost::take(const UsbAnswer& answer, std::uint32_t tick) {
  if (answer.kind == UsbRecord::wake) return;
  if (answer.kind == UsbRecord::attach || answer.kind == UsbRecord::detach) {
    // Its firmware has begun anew: what was asked of the one before is not answered.
    is_attached_ = answer.kind == UsbRecord::attach;
    close();
    asked_.clear();
    asked_bytes_ = 0;
    phase_ = Phase::none;
    tries_ = 0;
    if (is_attached_ && is_plugged_) settle(tick, 0);
    return;
  }
  if (asked_.empty()) refuse("it answers what nobody has asked");
  const Asked asked = asked_.front();
  asked_.pop_front();
  asked_bytes_ -= asked.record_bytes;
  if (answer.kind == UsbRecord::refused) refuse("it refuses a record");
  if (asked.kind == Asked::Kind::nobodys) return;
  if (answer.address != asked.address) refuse("it answers for another endpoint than was asked");
  const bool is_gone = answer.kind == UsbRecord::stall || answer.kind == UsbRecord::silence;
  if (asked.kind == Asked::Kind::control) {
    enumeration_.take(answer, tick);
    if (phase_ == Phase::enumerating && enumeration_.state() == UsbEnumeration::State::done) {
      phase_ = Phase::open;
      was_open_ = true;
      had_data_ = true;
      tries_ = 0;
    }
  } else if (is_gone) {
    // Neither is anything that this device does with its bulk endpoints: it is begun with anew.
    if (phase_ == Phase::open) settle(tick, 0);
  } else if (asked.kind == Asked::Kind::in) {
    take_in(asked, answer);
  } else if (asked.is_taken) {
    const UsbOutPipe::Taken taken = out_.take(answer.kind);
    if (!taken.is_good)
      refuse("no handshake answers a packet, or it takes one behind one that it has refused");
    sides_[0].bytes_delivered += taken.bytes;
    sides_[0].busy += taken.bytes + kUsbTransactionOverheadBytes * taken.packets;
  }
}

void UsbHost::take_in(const Asked& asked, const UsbAnswer& answer) {
  if (answer.kind == UsbRecord::nak) return;
  if (answer.kind != UsbRecord::data0 && answer.kind != UsbRecord::data1)
    refuse("it acknowledges where it is asked for data");
  const std::uint64_t duration = kUsbTransactionOverheadBytes + answer.data.size();
  debt_ += duration - kUsbRefusedInBytes;
  had_data_ = true;
  if (!asked.is_acknowledged) ++sides_[asked.is_taken ? 0 : 1].attempts_failed;
  if (!asked.is_taken) return;
  const UsbInPipe::Taken taken = in_.take(answer);
  if (taken.is_copy) return;
  sides_[1].bytes_accepted += answer.data.size();
  sides_[1].busy += duration;
  if (taken.ends_transfer && !program_runs_ && in_buffers_ != 0) --in_buffers_;
}

bool UsbHost::submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  advance(tick);
  if (direction == 1) {
    reader_.feed(bytes);
    while (const std::optional<UsbAnswer> answer = reader_.next()) take(*answer, tick);
    if (std::vector<std::uint8_t> ended = in_.completed(); !ended.empty())
      received_.emplace_back(tick, std::move(ended));
    return true;
  }
  if (bytes.empty()) return true;
  Side& side = sides_[0];
  if (phase_ != Phase::open) {
    ++frames_unsent_;
    return false;
  }
  if (out_.waiting_bytes() + bytes.size() > queue_limit_bytes_) {
    ++side.submissions_dropped;
    side.bytes_dropped += bytes.size();
    return false;
  }
  side.bytes_accepted += bytes.size();
  out_.submit(bytes);
  return true;
}

std::vector<std::uint8_t> UsbHost::deliver(std::size_t direction, std::uint32_t tick) {
  advance(tick);
  if (direction == 0) return std::exchange(records_, {});
  std::vector<std::uint8_t> bytes;
  for (; !received_.empty() && received_.front().first < tick; received_.pop_front())
    bytes.insert(bytes.end(), received_.front().second.begin(), received_.front().second.end());
  sides_[1].bytes_delivered += bytes.size();
  return bytes;
}

std::size_t UsbHost::backlog_bytes(std::size_t direction, std::uint32_t) const {
  return direction == 0 ? out_.waiting_bytes() : 0;
}

MediumCounters UsbHost::counters(std::size_t direction) const {
  const Side& side = sides_[direction];
  return {.bytes_accepted = side.bytes_accepted,
          .bytes_delivered = side.bytes_delivered,
          .bytes_dropped = side.bytes_dropped,
          .submissions_dropped = side.submissions_dropped,
          .attempts_failed = side.attempts_failed,
          .busy_ticks = static_cast<double>(side.busy) / static_cast<double>(kUsbFrameBytes)};
}

}  // namespace palpate::link
