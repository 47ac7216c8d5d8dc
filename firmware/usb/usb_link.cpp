#include "firmware/usb/usb_link.hpp"

#include <algorithm>

#include "tusb.h"

namespace palpate::firmware::usb {
namespace {

// TinyUSB calls functions, not objects.
UsbLink* the_link = nullptr;

constexpr std::uint16_t kTextDescriptor = 3;
constexpr std::uint16_t kUsEnglish = 0x0409;
constexpr std::uint8_t kDelimiter = 0;

}  // namespace

UsbLink::UsbLink(LinkBuffers& link, const std::array<std::uint8_t, 16>& unique_id)
    : link_(link), unique_id_(unique_id) {
  the_link = this;
}

void UsbLink::begin() {
  tud_init(TUD_OPT_RHPORT);
}

void UsbLink::service() {
  tud_task();
  if (!tud_mounted()) {
    start_over();
    return;
  }
  receive();
  transmit();
}

bool UsbLink::has_work() {
  return tud_task_event_ready();
}

void UsbLink::tick() {
  if (!vendor_open_ || !packet_waits_ || ++waited_ticks_ < kPatience_ticks) return;
  vendor_open_ = false;
  empty_due_ = false;
}

// No configuration, so nobody to talk to: after a reset of the bus, too.
void UsbLink::start_over() {
  if (packet_waits_ && end_waits_) ++link_.frames_unsent;
  carrier_ = Function::vendor;
  serial_open_ = vendor_open_ = packet_waits_ = empty_due_ = false;
  discard_all();
}

void UsbLink::open(Function function) {
  if (carrier_ != function) skip_rest_of_frame();
  carrier_ = function;
  if (function == Function::vendor) {
    vendor_open_ = true;
  } else {
    empty_due_ = false;
  }
}

// Reading also makes an endpoint ready again whose halt the host has cleared.
void UsbLink::receive() {
  std::array<std::uint8_t, kPacketBytes> bytes;
  auto room = [&] { return std::min<std::uint32_t>(kPacketBytes, link_.received.free()); };
  if (const std::size_t count = tud_vendor_read(bytes.data(), room()); count != 0) {
    (void)link_.received.write(std::span(bytes).first(count));
    open(Function::vendor);
  }
  if (const std::size_t count = tud_cdc_read(bytes.data(), room()); count != 0) {
    (void)link_.received.write(std::span(bytes).first(count));
    serial_open_ = true;
    open(Function::serial);
  }
}

void UsbLink::transmit() {
  if (!is_open() || tud_suspended()) discard_all();
  transmit_to_vendor();
  if (carrier_ == Function::serial) transmit_to_serial();
}

void UsbLink::transmit_to_vendor() {
  if (!tud_vendor_n_write_ready(0)) return;
  const bool was_taken = packet_waits_;
  packet_waits_ = false;
  if (carrier_ != Function::vendor) return;
  // The first that is taken opens; what was said before is gone.
  if (was_taken) vendor_open_ = true;
  std::array<std::uint8_t, kPacketBytes> bytes;
  std::size_t length = 0;
  if (vendor_open_ && !empty_due_) {
    const Packet packet = take(bytes);
    if (packet.length == 0) return;
    length = packet.length;
    end_waits_ = packet.ends_frame;
    empty_due_ = packet.ends_frame && length == kPacketBytes;
  } else {
    empty_due_ = end_waits_ = false;
  }
  packet_waits_ = tud_vendor_n_write_packet(0, bytes.data(), static_cast<std::uint16_t>(length));
  waited_ticks_ = 0;
}

void UsbLink::transmit_to_serial() {
  std::array<std::uint8_t, kPacketBytes> bytes;
  const std::size_t room = std::min<std::size_t>(kPacketBytes, tud_cdc_write_available());
  const Packet packet = take(std::span(bytes).first(room));
  tud_cdc_write(bytes.data(), static_cast<std::uint32_t>(packet.length));
  tud_cdc_write_flush();
}

UsbLink::Packet UsbLink::take(std::span<std::uint8_t> bytes) {
  const std::size_t there = link_.transmit.peek(bytes);
  std::size_t length = 0;
  bool ends_frame = false;
  while (length < there && !ends_frame) {
    const bool is_delimiter = bytes[length++] == kDelimiter;
    ends_frame = is_delimiter && within_frame_;
    within_frame_ = !is_delimiter;
  }
  link_.transmit.skip(length);
  return {.length = length, .ends_frame = ends_frame};
}

void UsbLink::skip_rest_of_frame() {
  while (within_frame_ && discard_some()) {
  }
}

// Frames are whole in the ring, so behind them the next one begins.
void UsbLink::discard_all() {
  while (discard_some()) {
  }
  within_frame_ = false;
}

bool UsbLink::discard_some() {
  std::array<std::uint8_t, kPacketBytes> bytes;
  const Packet packet = take(bytes);
  if (packet.ends_frame) ++link_.frames_unsent;
  return packet.length != 0;
}

const std::uint16_t* UsbLink::text_descriptor(Text index) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::size_t length = 0;
  auto add = [&](std::uint16_t character) {
    if (length + 1 < text_.size()) text_[++length] = character;
  };
  if (index == Text::languages) {
    add(kUsEnglish);
  } else if (index == Text::serial) {
    for (const std::uint8_t byte : unique_id_) {
      add(static_cast<std::uint8_t>(kDigits[byte >> 4]));
      add(static_cast<std::uint8_t>(kDigits[byte & 0xF]));
    }
  } else {
    const char* one = text(index);
    if (one == nullptr) return nullptr;
    for (; *one != '\0'; ++one) add(static_cast<std::uint8_t>(*one));
  }
  text_[0] = static_cast<std::uint16_t>(kTextDescriptor << 8 | 2 * (length + 1));
  return text_.data();
}

void UsbLink::note_line_state(bool is_open) {
  const bool opens = is_open && !serial_open_;
  serial_open_ = is_open;
  if (opens) {
    tud_cdc_write_clear();
    open(Function::serial);
  } else if (!is_open && carrier_ == Function::serial) {
    skip_rest_of_frame();
    carrier_ = Function::vendor;
    vendor_open_ = false;
  }
}

}  // namespace palpate::firmware::usb

namespace usb = palpate::firmware::usb;

extern "C" {

const std::uint8_t* tud_descriptor_device_cb() {
  return usb::device_descriptor();
}

const std::uint8_t* tud_descriptor_configuration_cb(std::uint8_t index) {
  return index == 0 ? usb::configuration_descriptor() : nullptr;
}

const std::uint8_t* tud_descriptor_bos_cb() {
  return usb::object_store_descriptor();
}

const std::uint16_t* tud_descriptor_string_cb(std::uint8_t index, std::uint16_t) {
  return usb::the_link == nullptr ? nullptr : usb::the_link->text_descriptor(static_cast<usb::Text>(index));
}

bool tud_vendor_control_xfer_cb(std::uint8_t port, std::uint8_t stage,
                                const tusb_control_request_t* request) {
  if (stage != CONTROL_STAGE_SETUP) return true;
  if (request->bmRequestType_bit.type != TUSB_REQ_TYPE_VENDOR ||
      request->bmRequestType_bit.direction != TUSB_DIR_IN || request->bRequest != usb::kMicrosoftRequest ||
      request->wIndex != usb::kMicrosoftDescriptorIndex)
    return false;
  const usb::MicrosoftDescriptors set = usb::microsoft_descriptors();
  return tud_control_xfer(port, request, const_cast<std::uint8_t*>(set.data), set.length);
}

void tud_cdc_line_state_cb(std::uint8_t, bool is_ready, bool) {
  if (usb::the_link != nullptr) usb::the_link->note_line_state(is_ready);
}

}  // extern "C"
