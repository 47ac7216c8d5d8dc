#include "host/link/usb_ideal_device.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace palpate::link {
namespace {

constexpr std::uint8_t kControlIn = 0x80;
constexpr std::array<std::uint8_t, 18> kDevice{18, 1, 0, 2, 0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
// One interface of the vendor's class with a bulk endpoint each way.
constexpr std::array<std::uint8_t, 32> kConfiguration{9, 2,    32,
                                                      0, 1,    1,
                                                      0, 0x80, 50,  //
                                                      9, 4,    0,
                                                      0, 2,    0xFF,
                                                      0, 0,    0,  //
                                                      7, 5,    UsbIdealDevice::kOut,
                                                      2, 64,   0,
                                                      0,  //
                                                      7, 5,    UsbIdealDevice::kIn,
                                                      2, 64,   0,
                                                      0};

}  // namespace

void UsbIdealDevice::answer(UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data) {
  append_usb_record(answers_, kind, address, data);
}

std::vector<std::uint8_t> UsbIdealDevice::tick(std::span<const std::uint8_t> records) {
  if (!std::exchange(is_attached_, true)) answer(UsbRecord::attach, 0);
  std::vector<std::uint8_t> earlier = std::exchange(answers_, {});
  while (!records.empty()) {
    if (records.size() < lockstep::kUsbHeaderBytes || records.size() < lockstep::kUsbHeaderBytes + records[2])
      throw std::logic_error("UsbIdealDevice: a record that is cut");
    const std::size_t length = records[2];
    if (!is_silent_)
      take(static_cast<UsbRecord>(records[0]), records[1],
           records.subspan(lockstep::kUsbHeaderBytes, length));
    records = records.subspan(lockstep::kUsbHeaderBytes + length);
  }
  return earlier;
}

void UsbIdealDevice::say(std::span<const std::uint8_t> frame) {
  for (std::size_t at = 0; at <= frame.size(); at += lockstep::kUsbPacketBytes) {
    const auto part = frame.subspan(at, std::min(lockstep::kUsbPacketBytes, frame.size() - at));
    packets_.emplace_back(part.begin(), part.end());
  }
}

void UsbIdealDevice::take(UsbRecord kind, std::uint8_t flagged, std::span<const std::uint8_t> data) {
  const auto address = static_cast<std::uint8_t>(flagged & ~lockstep::kUsbAgain);
  switch (kind) {
    case UsbRecord::reset:
      ++resets_;
      out_toggle_ = in_toggle_ = 0;
      is_refusing_ = false;
      packets_.clear();
      return;
    case UsbRecord::setup:
      take_setup(data);
      return;
    case UsbRecord::in:
      if (address == kIn) {
        give(flagged == address);
      } else {
        const std::size_t count = std::min(descriptor_.size(), lockstep::kUsbPacketBytes);
        answer(control_toggle_ == 1 ? UsbRecord::data1 : UsbRecord::data0, kControlIn,
               std::span(descriptor_).first(count));
        descriptor_.erase(descriptor_.begin(), descriptor_.begin() + static_cast<std::ptrdiff_t>(count));
        control_toggle_ ^= 1;
      }
      return;
    case UsbRecord::out_data0:
    case UsbRecord::out_data1:
      if (address == kOut) {
        take_out(kind, flagged != address, data);
      } else {
        answer(UsbRecord::ack, address);
      }
      return;
    case UsbRecord::frame:
    case UsbRecord::suspend:
    case UsbRecord::resume:
    case UsbRecord::unplug:
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
      return;
  }
}

void UsbIdealDevice::take_setup(std::span<const std::uint8_t> setup) {
  answer(UsbRecord::ack, 0);
  control_toggle_ = 1;
  descriptor_.clear();
  constexpr std::uint8_t kGetDescriptor = 6;
  if (setup[1] != kGetDescriptor) return;
  const std::span<const std::uint8_t> whole =
      setup[3] == 1 ? std::span<const std::uint8_t>(kDevice) : std::span<const std::uint8_t>(kConfiguration);
  const std::size_t asked = setup[6] | static_cast<std::size_t>(setup[7]) << 8;
  descriptor_.assign(whole.begin(),
                     whole.begin() + static_cast<std::ptrdiff_t>(std::min(asked, whole.size())));
}

void UsbIdealDevice::take_out(UsbRecord kind, bool again, std::span<const std::uint8_t> data) {
  if (again) is_refusing_ = false;
  const std::uint8_t toggle = kind == UsbRecord::out_data1 ? 1 : 0;
  if (is_refusing_ || (toggle == out_toggle_ && refusals_ != 0)) {
    if (!is_refusing_) --refusals_;
    is_refusing_ = true;
    answer(UsbRecord::nak, kOut);
    return;
  }
  answer(UsbRecord::ack, kOut);
  if (toggle != out_toggle_) {
    ++copies_;
    return;
  }
  out_toggle_ ^= 1;
  heard_.insert(heard_.end(), data.begin(), data.end());
}

void UsbIdealDevice::give(bool is_heard) {
  if (packets_.empty()) {
    answer(UsbRecord::nak, kIn);
    return;
  }
  answer(in_toggle_ == 0 ? UsbRecord::data0 : UsbRecord::data1, kIn, packets_.front());
  if (!is_heard) return;
  in_toggle_ ^= 1;
  packets_.pop_front();
}

}  // namespace palpate::link
