#include "shared/wire/can_receiver.hpp"

#include <algorithm>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

using State = CanReassembly::State;

// Frames with the same of these bits belong to one sequence of transfers: all but the priority, and the bits
// of messages that receivers ignore.
constexpr std::uint32_t kService = 1u << 25;
constexpr std::uint32_t kIgnoredInMessages = 3u << 21;
constexpr std::uint32_t kPriority = 7u << 26;

std::uint32_t what_counts(std::uint32_t identifier) {
  return (identifier & kService) != 0 ? identifier : identifier & ~kIgnoredInMessages;
}

std::uint32_t session(std::uint32_t identifier) {
  return what_counts(identifier) & ~kPriority;
}

bool timed_out(const CanReassembly& transfer, std::uint32_t now_tick) {
  return now_tick - transfer.last_tick >= kCanTransferTimeout_ticks;
}

}  // namespace

CanReassembly* CanDecoder::find(std::uint32_t identifier) {
  for (CanReassembly& transfer : transfers_)
    if (transfer.state != State::unused && session(transfer.identifier) == session(identifier))
      return &transfer;
  return nullptr;
}

bool CanDecoder::may_hold(const CanReassembly& transfer, std::uint16_t specifier) const {
  const std::uint16_t kept_for = rooms_[static_cast<std::size_t>(&transfer - transfers_.data())].specifier;
  return kept_for == kAnySpecifier || kept_for == specifier;
}

bool CanDecoder::any_may_hold(std::uint16_t specifier) const {
  for (const CanReassembly& transfer : transfers_)
    if (may_hold(transfer, specifier)) return true;
  return false;
}

// An unused entry, or of those that are over the one that was silent longest.
CanReassembly* CanDecoder::room_for_a_stray(const Part& part) {
  CanReassembly* best = nullptr;
  for (CanReassembly& transfer : transfers_) {
    if (!may_hold(transfer, part.specifier)) continue;
    if (transfer.state == State::unused) return &transfer;
    if (transfer.state == State::open) continue;
    if (best == nullptr || part.tick - transfer.last_tick > part.tick - best->last_tick) best = &transfer;
  }
  return best;
}

CanReassembly* CanDecoder::room_for_a_start(const Part& part) {
  if (CanReassembly* room = room_for_a_stray(part); room != nullptr) return room;
  for (CanReassembly& transfer : transfers_) {
    if (!may_hold(transfer, part.specifier) || !timed_out(transfer, part.tick)) continue;
    counters_.count(Status::transfer_incomplete);
    return &transfer;
  }
  return nullptr;
}

std::span<std::uint8_t> CanDecoder::bytes_of(const CanReassembly& transfer) const {
  const auto index = static_cast<std::size_t>(&transfer - transfers_.data());
  std::size_t begin = 0;
  for (std::size_t i = 0; i < index; ++i) begin += can_room_bytes(rooms_[i]);
  return buffer_.subspan(begin, can_room_bytes(rooms_[index]));
}

// A bus may bring a frame twice, when its sender did not see that it was received. Frames that say the same
// by chance, with those between them lost, are left to the CRC.
bool CanDecoder::repeats(const CanReassembly& transfer, const Part& part) const {
  if (part.identifier != transfer.identifier || part.tail.transfer_id != transfer.transfer_id) return false;
  if (part.tail.end || part.content.size() + kCanTailBytes != transfer.frame_bytes) return false;
  if (part.tail.start != (transfer.length == part.content.size())) return false;
  const std::span<const std::uint8_t> last =
      bytes_of(transfer).subspan(transfer.length - part.content.size(), part.content.size());
  // With a predicate, or it is memcmp(), whose stack the image's check does not know.
  return std::equal(last.begin(), last.end(), part.content.begin(),
                    [](std::uint8_t a, std::uint8_t b) { return a == b; });
}

void CanDecoder::refuse(CanReassembly& transfer, const Part& part, Status fault) {
  counters_.count(fault);
  transfer = {.state = part.tail.end ? State::unused : State::refused,
              .transfer_id = part.tail.transfer_id,
              .identifier = part.identifier,
              .last_tick = part.tick};
}

void CanDecoder::append(CanReassembly& transfer, const Part& part) {
  const std::span<std::uint8_t> bytes = bytes_of(transfer);
  if (part.content.size() > bytes.size() - transfer.length) {
    refuse(transfer, part, Status::frame_too_long);
    return;
  }
  std::copy(part.content.begin(), part.content.end(), bytes.begin() + transfer.length);
  transfer.length = static_cast<std::uint16_t>(transfer.length + part.content.size());
  transfer.crc = crc16_update(transfer.crc, part.content);
  transfer.next_toggle = !part.tail.toggle;
  transfer.last_tick = part.tick;
}

void CanDecoder::start(const Part& part) {
  CanReassembly* transfer = find(part.identifier);
  if (transfer != nullptr && transfer->state == State::open) {
    if (!timed_out(*transfer, part.tick) && repeats(*transfer, part)) {
      ++counters_.repeated_can_frames;
      return;
    }
    counters_.count(Status::transfer_incomplete);  // the one before was cut off
  }
  if (transfer == nullptr) transfer = room_for_a_start(part);
  if (transfer == nullptr) {
    counters_.count(Status::too_many_transfers);
    return;
  }
  *transfer = {.state = State::open,
               .next_toggle = false,
               .transfer_id = part.tail.transfer_id,
               .frame_bytes = static_cast<std::uint8_t>(part.content.size() + kCanTailBytes),
               .crc = kCrc16Initial,
               .length = 0,
               .identifier = part.identifier,
               .last_tick = part.tick};
  append(*transfer, part);
}

// A frame that does not start its transfer. Returns the transfer that it completed, or nullptr.
CanReassembly* CanDecoder::proceed(const Part& part) {
  CanReassembly* transfer = find(part.identifier);
  if (transfer == nullptr) {
    // Its start was lost. With every entry in use nothing can be remembered of it, and nothing is counted.
    transfer = room_for_a_stray(part);
    if (transfer != nullptr) refuse(*transfer, part, Status::transfer_incomplete);
    return nullptr;
  }
  const bool same = part.tail.transfer_id == transfer->transfer_id && !timed_out(*transfer, part.tick);
  if (transfer->state == State::complete && same && part.tail.end &&
      part.tail.toggle != transfer->next_toggle) {
    ++counters_.repeated_can_frames;
    return nullptr;
  }
  if (transfer->state == State::refused && same) {
    transfer->last_tick = part.tick;
    if (part.tail.end) transfer->state = State::unused;
    return nullptr;
  }
  if (transfer->state != State::open || !same || part.identifier != transfer->identifier) {
    refuse(*transfer, part, Status::transfer_incomplete);
    return nullptr;
  }
  if (part.tail.toggle != transfer->next_toggle && repeats(*transfer, part)) {
    ++counters_.repeated_can_frames;
    return nullptr;
  }
  const std::size_t data_bytes = part.content.size() + kCanTailBytes;
  const bool fits = part.tail.end ? data_bytes <= transfer->frame_bytes : data_bytes == transfer->frame_bytes;
  if (part.tail.toggle != transfer->next_toggle || !fits) {
    refuse(*transfer, part, Status::transfer_incomplete);
    return nullptr;
  }
  append(*transfer, part);
  if (!part.tail.end || transfer->state != State::open) return nullptr;
  if (transfer->crc != 0 || transfer->length < kCanTransferCrcBytes) {
    refuse(*transfer, part, Status::payload_crc_mismatch);
    return nullptr;
  }
  transfer->state = State::complete;
  return transfer;
}

bool CanDecoder::take(const CanFrame& frame, std::uint32_t now_tick, Frame& out) {
  if (frame.data.empty() || frame.data.size() > single_.size()) {
    counters_.count(frame.data.empty() ? Status::frame_too_short : Status::frame_too_long);
    return false;
  }
  Part part{.identifier = what_counts(frame.identifier),
            .specifier = 0,
            .tail = parse_can_tail(frame.data.back()),
            .content = frame.data.first(frame.data.size() - kCanTailBytes),
            .tick = now_tick};
  FrameHeader header;
  const bool single = part.tail.start && part.tail.end;
  const Status status = parse_can_identifier(frame.identifier, header);
  // Toggle 0 at the start is the protocol's version 0; a node without a number sends single frames only.
  if (status != Status::ok || (part.tail.start && !part.tail.toggle) ||
      (header.source == kBroadcast && !single)) {
    counters_.count(Status::header_version_unknown);
    return false;
  }
  header.transfer_id = part.tail.transfer_id;
  part.specifier = header.specifier;
  if (node_ != kBroadcast && !addressed_to(header, node_)) return false;
  if (!single && !any_may_hold(part.specifier)) return false;

  if (single) {
    CanReassembly* cut_off = find(part.identifier);
    if (cut_off != nullptr && cut_off->state == State::open) {
      // Of the same transfer: then it is not known which of the two is wrong.
      const bool contradicts = cut_off->transfer_id == part.tail.transfer_id;
      refuse(*cut_off, part, Status::transfer_incomplete);
      if (contradicts) return false;
    }
    std::copy(part.content.begin(), part.content.end(), single_.begin());
    out = {.header = header, .payload = std::span<const std::uint8_t>(single_).first(part.content.size())};
  } else {
    if (part.tail.start) {
      start(part);
      return false;
    }
    const CanReassembly* complete = proceed(part);
    if (complete == nullptr) return false;
    out = {.header = header, .payload = bytes_of(*complete).first(complete->length - kCanTransferCrcBytes)};
  }
  ++counters_.frames;
  return true;
}

Reception CanDecoder::receive(std::span<const std::uint8_t> bytes, std::uint32_t now_tick) {
  Reception reception;
  while (true) {
    const CanRecordReader::Step step = records_.read(bytes.subspan(reception.consumed));
    reception.consumed += step.consumed;
    if (step.found == CanRecordReader::Found::nothing) return reception;
    if (step.found == CanRecordReader::Found::damage) {
      counters_.count(Status::can_record_invalid);
    } else if (take(step.frame, now_tick, reception.frame)) {
      reception.complete = true;
      return reception;
    }
  }
}

}  // namespace palpate::wire
