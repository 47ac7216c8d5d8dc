#include "shared/wire/frame_receiver.hpp"

#include <algorithm>

namespace palpate::wire {

Status FrameDecoder::finish(Frame& frame) const {
  if (!cobs_.whole()) return Status::cobs_invalid;
  if (length_ < kFrameOverheadBytes) return Status::frame_too_short;
  const Status status = parse_header(buffer_.first<kHeaderBytes>(), frame.header);
  if (status != Status::ok) return status;
  if (crc_ != kCrc32cResidue) return Status::payload_crc_mismatch;
  frame.payload = buffer_.subspan(kHeaderBytes, length_ - kFrameOverheadBytes);
  return Status::ok;
}

Reception FrameDecoder::receive(std::span<const std::uint8_t> bytes) {
  Reception reception;
  while (reception.consumed < bytes.size()) {
    const std::span<const std::uint8_t> rest = bytes.subspan(reception.consumed);
    if (skipping_) {
      const auto delimiter = std::find(rest.begin(), rest.end(), kCobsDelimiter);
      reception.consumed += static_cast<std::size_t>(delimiter - rest.begin());
      if (delimiter == rest.end()) return reception;
      ++reception.consumed;
      skipping_ = false;
      continue;
    }
    const CobsDecoder::Step step = cobs_.decode(rest, buffer_.subspan(length_));
    reception.consumed += step.consumed;
    const std::size_t checked = std::max(length_, kHeaderBytes);  // bytes that crc_ covers already
    length_ += step.written;
    if (length_ > checked) crc_ = crc32c_update(crc_, buffer_.subspan(checked, length_ - checked));
    if (step.stop == CobsDecoder::Stop::input_end) return reception;

    if (step.stop == CobsDecoder::Stop::output_full) {
      counters_.count(Status::frame_too_long);
      skipping_ = true;
    } else if (!cobs_.empty()) {
      const Status status = finish(reception.frame);
      reception.complete = status == Status::ok;
      if (reception.complete) {
        ++counters_.frames;
      } else {
        counters_.count(status);
      }
    }
    cobs_.reset();
    length_ = 0;
    crc_ = kCrc32cInitial;
    if (reception.complete) return reception;
  }
  return reception;
}

}  // namespace palpate::wire
