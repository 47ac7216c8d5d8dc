#include "host/link/usb_enumeration.hpp"

#include <algorithm>

namespace palpate::link {
namespace {

constexpr std::uint8_t kDevice = 1, kConfiguration = 2, kInterface = 4, kEndpoint = 5;  // descriptors
constexpr std::uint8_t kSetAddress = 5, kGetDescriptor = 6, kSetConfiguration = 9;      // requests
constexpr std::uint8_t kVendorClass = 0xFF, kKindMask = 3, kBulk = 2, kToHost = 0x80;
constexpr std::size_t kDeviceBytes = 18, kConfigurationHeadBytes = 9, kInterfaceBytes = 9, kEndpointBytes = 7;
constexpr std::uint8_t kAddress = 1;
// USB 2.0, 9.2.6.3.
constexpr std::uint32_t kAddressRecovery_ticks = 2;
// A device has this long for a stage of a standard request (9.2.6.4).
constexpr std::uint32_t kLongestStage_ticks = 500;
// Of a host that does not take any length that it is told.
constexpr std::size_t kMostConfigurationBytes = 1024;

}  // namespace

std::optional<UsbPipes> find_vendor_pipes(std::span<const std::uint8_t> descriptor) {
  if (descriptor.size() < kConfigurationHeadBytes || descriptor[1] != kConfiguration) return std::nullopt;
  UsbPipes pipes{.configuration = descriptor[5]};
  bool is_vendors = false;
  while (descriptor.size() >= 2) {
    const std::size_t length = descriptor[0];
    if (length < 2 || length > descriptor.size()) return std::nullopt;
    if (descriptor[1] == kInterface && length >= kInterfaceBytes) {
      is_vendors = descriptor[5] == kVendorClass && descriptor[3] == 0;
      pipes.out = pipes.in = 0;
    } else if (is_vendors && descriptor[1] == kEndpoint && length >= kEndpointBytes &&
               (descriptor[3] & kKindMask) == kBulk && descriptor[4] == lockstep::kUsbPacketBytes) {
      std::uint8_t& way = (descriptor[2] & kToHost) != 0 ? pipes.in : pipes.out;
      if (way == 0) way = descriptor[2];
      if (pipes.in != 0 && pipes.out != 0) return pipes;
    }
    descriptor = descriptor.subspan(length);
  }
  return std::nullopt;
}

void UsbEnumeration::begin(Step step, std::uint32_t tick) {
  step_ = step;
  stage_ = Stage::setup;
  stage_tick_ = tick;
  toggle_ = 1;
  received_.clear();
  asked_bytes_ = step == Step::device               ? kDeviceBytes
                 : step == Step::configuration_head ? kConfigurationHeadBytes
                 : step == Step::configuration      ? configuration_bytes_
                                                    : 0;
}

std::optional<UsbEnumeration::Token> UsbEnumeration::next(std::uint32_t tick) {
  if (!has_begun_) {
    has_begun_ = true;
    begin(Step::device, tick);
  }
  if (state_ != State::running || tick < not_before_tick_) return std::nullopt;
  if (tick - stage_tick_ > kLongestStage_ticks) state_ = State::failed;
  if (waits_ || state_ != State::running) return std::nullopt;
  waits_ = true;
  const auto setup = [&](std::uint8_t kind, std::uint8_t request, std::uint8_t low, std::uint8_t high) {
    return Token{UsbRecord::setup,
                 0,
                 {kind, request, low, high, 0, 0, static_cast<std::uint8_t>(asked_bytes_ & 0xFF),
                  static_cast<std::uint8_t>(asked_bytes_ >> 8)}};
  };
  switch (stage_) {
    case Stage::setup:
      switch (step_) {
        case Step::device:
          return setup(kToHost, kGetDescriptor, 0, kDevice);
        case Step::address:
          return setup(0, kSetAddress, kAddress, 0);
        case Step::configuration_head:
        case Step::configuration:
          return setup(kToHost, kGetDescriptor, 0, kConfiguration);
        case Step::configure:
          return setup(0, kSetConfiguration, pipes_.configuration, 0);
      }
      break;
    case Stage::data_in:
    case Stage::status_in:
      return Token{UsbRecord::in, kToHost, {}};
    case Stage::status_out:
      return Token{UsbRecord::out_data1, lockstep::kUsbAgain, {}};
  }
  return std::nullopt;
}

void UsbEnumeration::take(const UsbAnswer& answer, std::uint32_t tick) {
  waits_ = false;
  if (state_ != State::running || answer.kind == UsbRecord::nak) return;
  const bool is_data = answer.kind == UsbRecord::data0 || answer.kind == UsbRecord::data1;
  const bool wants_data = stage_ == Stage::data_in || stage_ == Stage::status_in;
  const std::uint8_t toggle = answer.kind == UsbRecord::data1 ? 1 : 0;
  if ((wants_data && (!is_data || toggle != toggle_)) || (!wants_data && answer.kind != UsbRecord::ack)) {
    state_ = State::failed;
    return;
  }
  stage_tick_ = tick;
  switch (stage_) {
    case Stage::setup:
      stage_ = asked_bytes_ != 0 ? Stage::data_in : Stage::status_in;
      return;
    case Stage::data_in:
      take_data(answer);
      return;
    case Stage::status_in:
    case Stage::status_out:
      end_transfer(tick);
      return;
  }
}

void UsbEnumeration::take_data(const UsbAnswer& answer) {
  toggle_ ^= 1;
  received_.insert(received_.end(), answer.data.begin(), answer.data.end());
  if (received_.size() > asked_bytes_) {
    state_ = State::failed;
  } else if (answer.data.size() < lockstep::kUsbPacketBytes || received_.size() == asked_bytes_) {
    stage_ = Stage::status_out;
  }
}

void UsbEnumeration::end_transfer(std::uint32_t tick) {
  const auto is = [&](std::size_t length, std::uint8_t kind) {
    return received_.size() == length && received_[1] == kind;
  };
  switch (step_) {
    case Step::device:
      if (!is(kDeviceBytes, kDevice)) break;
      begin(Step::address, tick);
      return;
    case Step::address:
      not_before_tick_ = tick + kAddressRecovery_ticks;
      begin(Step::configuration_head, tick);
      return;
    case Step::configuration_head:
      if (!is(kConfigurationHeadBytes, kConfiguration)) break;
      configuration_bytes_ = received_[2] | static_cast<std::size_t>(received_[3]) << 8;
      if (configuration_bytes_ < kConfigurationHeadBytes || configuration_bytes_ > kMostConfigurationBytes)
        break;
      begin(Step::configuration, tick);
      return;
    case Step::configuration: {
      if (!is(configuration_bytes_, kConfiguration)) break;
      const std::optional<UsbPipes> found = find_vendor_pipes(received_);
      if (!found) break;
      pipes_ = *found;
      begin(Step::configure, tick);
      return;
    }
    case Step::configure:
      state_ = State::done;
      return;
  }
  state_ = State::failed;
}

}  // namespace palpate::link
