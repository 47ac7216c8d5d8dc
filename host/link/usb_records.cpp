#include "host/link/usb_records.hpp"

#include <stdexcept>
#include <string>

namespace palpate::link {
namespace {

bool is_of_the_board(UsbRecord kind) {
  switch (kind) {
    case UsbRecord::attach:
    case UsbRecord::detach:
    case UsbRecord::wake:
    case UsbRecord::ack:
    case UsbRecord::nak:
    case UsbRecord::stall:
    case UsbRecord::data0:
    case UsbRecord::data1:
    case UsbRecord::silence:
    case UsbRecord::refused:
      return true;
    case UsbRecord::reset:
    case UsbRecord::frame:
    case UsbRecord::suspend:
    case UsbRecord::resume:
    case UsbRecord::unplug:
    case UsbRecord::setup:
    case UsbRecord::out_data0:
    case UsbRecord::out_data1:
    case UsbRecord::in:
      break;
  }
  return false;
}

}  // namespace

void append_usb_record(std::vector<std::uint8_t>& records, UsbRecord kind, std::uint8_t address,
                       std::span<const std::uint8_t> data) {
  records.push_back(static_cast<std::uint8_t>(kind));
  records.push_back(address);
  records.push_back(static_cast<std::uint8_t>(data.size()));
  records.insert(records.end(), data.begin(), data.end());
}

void UsbAnswerReader::feed(std::span<const std::uint8_t> bytes) {
  waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
}

std::optional<UsbAnswer> UsbAnswerReader::next() {
  if (waiting_.size() < lockstep::kUsbHeaderBytes) return std::nullopt;
  UsbAnswer answer{.kind = static_cast<UsbRecord>(waiting_[0]), .address = waiting_[1], .data = {}};
  const std::size_t length = waiting_[2];
  const bool is_data = answer.kind == UsbRecord::data0 || answer.kind == UsbRecord::data1;
  if (!is_of_the_board(answer.kind) || length > lockstep::kUsbPacketBytes || (length != 0 && !is_data))
    throw std::runtime_error("board: bytes " + std::to_string(waiting_[0]) + ", " +
                             std::to_string(waiting_[1]) + ", " + std::to_string(waiting_[2]) +
                             " on its USB bus begin no record that a device sends");
  if (waiting_.size() < lockstep::kUsbHeaderBytes + length) return std::nullopt;
  const auto data = waiting_.begin() + static_cast<std::ptrdiff_t>(lockstep::kUsbHeaderBytes);
  const auto end = data + static_cast<std::ptrdiff_t>(length);
  answer.data.assign(data, end);
  waiting_.erase(waiting_.begin(), end);
  return answer;
}

}  // namespace palpate::link
