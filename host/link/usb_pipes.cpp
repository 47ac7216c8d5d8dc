#include "host/link/usb_pipes.hpp"

#include <algorithm>

namespace palpate::link {

void UsbOutPipe::submit(std::span<const std::uint8_t> frame) {
  if (frame.empty()) return;
  constexpr std::size_t kFull = lockstep::kUsbPacketBytes;
  for (std::size_t at = 0; at < frame.size(); at += kFull) {
    const std::span<const std::uint8_t> part = frame.subspan(at, std::min(kFull, frame.size() - at));
    packets_.push_back({.bytes = {part.begin(), part.end()}, .ends_frame = at + kFull >= frame.size()});
  }
  if (frame.size() % kFull == 0) packets_.push_back({.bytes = {}});
}

void UsbOutPipe::append_packet(std::vector<std::uint8_t>& records, std::uint8_t address, bool is_answered) {
  const bool is_odd = ((toggle_ + next_) & 1u) != 0;
  const auto flagged = static_cast<std::uint8_t>(address | (again_ ? lockstep::kUsbAgain : 0));
  append_usb_record(records, is_odd ? UsbRecord::out_data1 : UsbRecord::out_data0, flagged,
                    packets_[next_].bytes);
  if (!is_answered) return;
  again_ = false;
  ++next_;
  ++unanswered_;
}

UsbOutPipe::Taken UsbOutPipe::take(UsbRecord handshake) {
  if (unanswered_ == 0) return {.is_good = false};
  --unanswered_;
  Taken taken;
  if (handshake == UsbRecord::ack && !is_refused_) {
    taken.packets = 1;
    taken.bytes = packets_.front().bytes.size();
    packets_.pop_front();
    --next_;
    toggle_ ^= 1;
  } else if (handshake == UsbRecord::nak) {
    is_refused_ = true;
  } else {
    taken.is_good = false;
  }
  if (is_refused_ && unanswered_ == 0) {
    is_refused_ = false;
    again_ = true;
    next_ = 0;
  }
  return taken;
}

std::size_t UsbOutPipe::waiting_bytes() const {
  std::size_t bytes = 0;
  for (std::size_t i = is_refused_ ? 0 : next_; i < packets_.size(); ++i) bytes += packets_[i].bytes.size();
  return bytes;
}

std::size_t UsbOutPipe::frames() const {
  return static_cast<std::size_t>(std::count_if(packets_.begin(), packets_.end(),
                                                [](const Packet& packet) { return packet.ends_frame; }));
}

UsbInPipe::Taken UsbInPipe::take(const UsbAnswer& packet) {
  if ((packet.kind == UsbRecord::data1 ? 1 : 0) != toggle_) return {.is_copy = true};
  toggle_ ^= 1;
  bytes_.insert(bytes_.end(), packet.data.begin(), packet.data.end());
  if (packet.data.size() == lockstep::kUsbPacketBytes && bytes_.size() - completed_bytes_ < kTransferBytes)
    return {};
  complete();
  return {.ends_transfer = true};
}

std::vector<std::uint8_t> UsbInPipe::completed() {
  const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(completed_bytes_);
  std::vector<std::uint8_t> bytes(bytes_.begin(), end);
  bytes_.erase(bytes_.begin(), end);
  completed_bytes_ = 0;
  return bytes;
}

}  // namespace palpate::link
