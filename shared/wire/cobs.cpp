#include "shared/wire/cobs.hpp"

#include <algorithm>

namespace palpate::wire {
namespace {

// Code byte of a block of kCobsRun bytes, the only one that no zero follows.
constexpr std::uint8_t kFullBlock = kCobsRun + 1;

}  // namespace

void CobsEncoder::put(std::span<const std::uint8_t> bytes) {
  const std::uint8_t* from = bytes.data();
  const std::uint8_t* const from_end = from + bytes.size();
  std::uint8_t* const out = out_.data();
  // Locals instead of members in the loop: the compiler must assume that bytes written may alias members.
  std::size_t length = length_;
  std::size_t code_at = code_at_;
  while (from != from_end && !overflow_) {
    // Each byte lengthens the encoding by one until the open block is full: no check for each byte is needed.
    const std::size_t room = out_.size() - std::min(length, out_.size());
    const std::size_t missing = kFullBlock - (length - code_at);
    const std::size_t batch = std::min({room, missing, static_cast<std::size_t>(from_end - from)});
    for (const std::uint8_t* const batch_end = from + batch; from != batch_end; ++from) {
      if (*from != 0) {
        out[length++] = *from;
      } else {
        out[code_at] = static_cast<std::uint8_t>(length - code_at);
        code_at = length++;
        after_full_block_ = false;
      }
    }
    overflow_ = batch == 0;
    if (length - code_at == kFullBlock) {
      out[code_at] = kFullBlock;
      code_at = length++;
      after_full_block_ = true;
    }
  }
  length_ = length;
  code_at_ = code_at;
}

std::size_t CobsEncoder::finish() {
  if (overflow_) return 0;
  // An empty block after a full one stands for nothing.
  if (after_full_block_ && length_ - code_at_ == 1) return code_at_;
  if (length_ > out_.size()) return 0;
  out_[code_at_] = static_cast<std::uint8_t>(length_ - code_at_);
  return length_;
}

CobsDecoder::Step CobsDecoder::decode(std::span<const std::uint8_t> in, std::span<std::uint8_t> out) {
  // Locals instead of members in the loop: the compiler must assume that bytes written may alias members.
  const std::uint8_t* from = in.data();
  const std::uint8_t* const from_end = from + in.size();
  std::uint8_t* to = out.data();
  std::uint8_t* const to_end = to + out.size();
  std::size_t left = left_;
  bool zero_due = zero_due_;
  Stop stop = Stop::input_end;
  while (stop == Stop::input_end && from != from_end) {
    // No byte decodes to more than one: no check for each byte is needed.
    std::size_t batch =
        std::min(static_cast<std::size_t>(from_end - from), static_cast<std::size_t>(to_end - to));
    if (batch == 0) {
      // No room: only a delimiter, or a code byte that stands for no zero, can still be taken.
      if (*from != kCobsDelimiter && (left != 0 || zero_due)) {
        stop = Stop::output_full;
        break;
      }
      batch = 1;
    }
    const std::uint8_t* const batch_end = from + batch;
    while (from != batch_end) {
      const std::uint8_t byte = *from++;
      if (byte == kCobsDelimiter) {
        stop = Stop::delimiter;
        break;
      }
      if (left != 0) {
        *to++ = byte;
        --left;
        continue;
      }
      if (zero_due) *to++ = 0;
      left = byte - 1u;
      zero_due = byte != kFullBlock;
      started_ = true;
    }
  }
  left_ = left;
  zero_due_ = zero_due;
  return {.consumed = static_cast<std::size_t>(from - in.data()),
          .written = static_cast<std::size_t>(to - out.data()),
          .stop = stop};
}

}  // namespace palpate::wire
