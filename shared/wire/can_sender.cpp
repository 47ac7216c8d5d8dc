#include "shared/wire/can_sender.hpp"

#include <algorithm>

namespace palpate::wire {
namespace {

constexpr std::size_t content_of_frame(CanFormat format) {
  return can_mtu(format) - kCanTailBytes;
}

}  // namespace

Status CanSender::begin(const FrameHeader& header, std::span<const std::uint8_t> payload, CanFormat format) {
  done_ = true;
  if (const Status status = can_identifier(header, identifier_); status != Status::ok) return status;
  format_ = format;
  tail_ = {.start = true,
           .end = false,
           .toggle = true,
           .transfer_id = static_cast<std::uint8_t>(header.transfer_id & kCanTransferIdMask)};
  payload_ = payload;
  content_bytes_ = can_content_bytes(payload.size(), format);
  single_ = payload.size() <= content_of_frame(format);
  at_ = 0;
  crc_ = kCrc16Initial;
  done_ = false;
  return Status::ok;
}

CanFrame CanSender::next() {
  const std::size_t bytes = std::min(content_of_frame(format_), content_bytes_ - at_);
  const std::size_t crc_at = single_ ? content_bytes_ : content_bytes_ - kCanTransferCrcBytes;
  const std::size_t from_payload = at_ < payload_.size() ? std::min(bytes, payload_.size() - at_) : 0;
  const std::size_t before_crc = at_ < crc_at ? std::min(bytes, crc_at - at_) : 0;
  const std::span<std::uint8_t> content = std::span(data_).first(bytes);
  std::copy_n(payload_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, payload_.size())), from_payload,
              content.begin());
  std::fill_n(content.begin() + static_cast<std::ptrdiff_t>(from_payload), before_crc - from_payload,
              std::uint8_t{0});
  if (!single_) crc_ = crc16_update(crc_, content.first(before_crc));
  for (std::size_t i = before_crc; i < bytes; ++i)
    content[i] = static_cast<std::uint8_t>((at_ + i == crc_at ? crc_ >> 8 : crc_) & 0xFF);

  at_ += bytes;
  done_ = tail_.end = at_ == content_bytes_;
  data_[bytes] = can_tail_byte(tail_);
  tail_.start = false;
  tail_.toggle = !tail_.toggle;
  return {.identifier = identifier_,
          .fd = format_ == CanFormat::fd,
          .data = std::span<const std::uint8_t>(data_).first(bytes + kCanTailBytes)};
}

std::size_t CanSender::write(std::span<std::uint8_t> out) {
  std::size_t written = 0;
  while (!done_) {
    const std::size_t next_bytes =
        std::min(can_mtu(format_), content_bytes_ - at_ + kCanTailBytes) + kCanRecordOverheadBytes;
    if (out.size() - written < next_bytes) break;
    written += write_can_record(next(), out.subspan(written));
  }
  return written;
}

}  // namespace palpate::wire
