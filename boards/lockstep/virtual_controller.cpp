#include "boards/lockstep/virtual_controller.hpp"

#include <algorithm>

#include "tusb_option.h"
// Behind the options that it reads.
#include "device/dcd.h"

namespace palpate::board {
namespace {

using lockstep::UsbRecord;

constexpr std::uint8_t kPort = 0;
constexpr std::uint8_t kToHost = 0x80, kNumber = 0x0F;
constexpr std::uint8_t kFlag = lockstep::kUsbAgain;
static_assert(lockstep::kUsbUnheard == kFlag);

VirtualController* the_controller = nullptr;

bool is_to_host(std::uint8_t address) {
  return (address & kToHost) != 0;
}

bool is_well_formed(UsbRecord kind, std::uint8_t address, std::size_t length) {
  switch (kind) {
    case UsbRecord::reset:
    case UsbRecord::frame:
    case UsbRecord::suspend:
    case UsbRecord::resume:
    case UsbRecord::unplug:
      return address == 0 && length == 0;
    case UsbRecord::setup:
      return address == 0 && length == lockstep::kUsbSetupBytes;
    case UsbRecord::out_data0:
    case UsbRecord::out_data1:
      return !is_to_host(address) && length <= lockstep::kUsbPacketBytes;  // with kUsbAgain or without
    case UsbRecord::in:
      return is_to_host(address) && length == 0;
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
      break;
  }
  return false;
}

}  // namespace

VirtualController::VirtualController(lockstep::UsbBus& bus) : bus_(bus) {
  the_controller = this;
}

void VirtualController::isr_receive(std::span<const std::uint8_t> records) {
  if (!bus_.to_board.write(records)) ++bus_.ticks_lost;
}

VirtualController::Step VirtualController::run_one() {
  if (bus_.from_board.free() < lockstep::kUsbRecordBytes) return Step::none;
  std::array<std::uint8_t, lockstep::kUsbRecordBytes> record;
  const std::size_t there = bus_.to_board.peek(record);
  if (there == 0) return Step::none;
  const auto kind = static_cast<UsbRecord>(record[0]);
  const std::uint8_t address = there > 1 ? record[1] : std::uint8_t{0};
  const std::size_t length = there > 2 ? record[2] : 0;
  if (there < lockstep::kUsbHeaderBytes || !is_well_formed(kind, address, length) ||
      there < lockstep::kUsbHeaderBytes + length) {
    refuse_rest();
    return Step::quiet;
  }
  bus_.to_board.skip(lockstep::kUsbHeaderBytes + length);
  const auto data = std::span(record).subspan(lockstep::kUsbHeaderBytes, length);
  return handle(kind, address, data) ? Step::event : Step::quiet;
}

// The interrupt publishes the records of a tick at once, so those that are there end where a tick ends.
void VirtualController::refuse_rest() {
  ++records_refused_;
  bus_.to_board.skip(bus_.to_board.size());
  answer(UsbRecord::refused, 0);
}

VirtualController::Pipe* VirtualController::find(std::uint8_t address) {
  const std::size_t number = address & kNumber;
  if (number >= kEndpoints || (address & ~(kToHost | kNumber)) != 0) return nullptr;
  Pipe& pipe = pipes_[number][is_to_host(address) ? 1 : 0];
  return pipe.packet_bytes == 0 ? nullptr : &pipe;
}

void VirtualController::reset() {
  pipes_ = {};
  for (Pipe& pipe : pipes_[0]) pipe.packet_bytes = CFG_TUD_ENDPOINT0_SIZE;
}

bool VirtualController::handle(UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data) {
  if (kind == UsbRecord::reset) {
    reset();
    dcd_event_bus_reset(kPort, TUSB_SPEED_FULL, false);
    return true;
  }
  if (kind == UsbRecord::unplug) {
    reset();
    dcd_event_bus_signal(kPort, DCD_EVENT_UNPLUGGED, false);
    return true;
  }
  if (kind == UsbRecord::suspend || kind == UsbRecord::resume) {
    dcd_event_bus_signal(kPort, kind == UsbRecord::suspend ? DCD_EVENT_SUSPEND : DCD_EVENT_RESUME, false);
    return true;
  }
  if (kind == UsbRecord::frame) return false;
  const bool is_flagged = (address & kFlag) != 0;
  address = static_cast<std::uint8_t>(address & ~kFlag);
  Pipe* const pipe = find(address);
  if (pipe == nullptr) return answer(UsbRecord::silence, address);
  if (kind == UsbRecord::setup) return take_setup(data);
  if (kind == UsbRecord::in) return give_in(*pipe, address, !is_flagged);
  if (is_flagged) pipe->refusing = false;
  return take_out(*pipe, address, kind == UsbRecord::out_data1 ? 1 : 0, data);
}

// Never refused: ends what was on its way on endpoint 0, and its halt.
bool VirtualController::take_setup(std::span<const std::uint8_t> data) {
  for (Pipe& pipe : pipes_[0]) pipe = {.packet_bytes = CFG_TUD_ENDPOINT0_SIZE, .toggle = 1};
  answer(UsbRecord::ack, 0);
  dcd_event_setup_received(kPort, data.data(), false);
  return true;
}

bool VirtualController::take_out(Pipe& pipe, std::uint8_t address, std::uint8_t toggle,
                                 std::span<const std::uint8_t> data) {
  if (pipe.halted) return answer(UsbRecord::stall, address);
  if (pipe.refusing || (!pipe.armed && toggle == pipe.toggle)) {
    pipe.refusing = true;
    return answer(UsbRecord::nak, address);
  }
  answer(UsbRecord::ack, address);
  if (toggle != pipe.toggle) return false;  // has come before
  pipe.toggle ^= 1;
  // What the stack has no room for is lost, as in a controller whose buffer ends.
  const std::size_t room = pipe.length - pipe.done;
  const std::size_t count = std::min(data.size(), room);
  if (count != 0) std::copy_n(data.begin(), count, pipe.data + pipe.done);
  return finish(pipe, address, count, data.size() < pipe.packet_bytes);
}

bool VirtualController::give_in(Pipe& pipe, std::uint8_t address, bool is_heard) {
  if (pipe.halted) return answer(UsbRecord::stall, address);
  if (!pipe.armed) return answer(UsbRecord::nak, address);
  const std::size_t count = std::min<std::size_t>(pipe.length - pipe.done, pipe.packet_bytes);
  answer(pipe.toggle == 0 ? UsbRecord::data0 : UsbRecord::data1, address, {pipe.data + pipe.done, count});
  if (!is_heard) return false;
  pipe.toggle ^= 1;
  return finish(pipe, address, count, false);
}

bool VirtualController::finish(Pipe& pipe, std::uint8_t address, std::size_t count, bool is_short) {
  pipe.done = static_cast<std::uint16_t>(pipe.done + count);
  if (!is_short && pipe.done != pipe.length) return false;
  pipe.armed = false;
  dcd_event_xfer_complete(kPort, address, pipe.done, XFER_RESULT_SUCCESS, false);
  return true;
}

// run_one() has seen to the room for an answer; what TinyUSB says by itself (attach, detach, wake) is rare
// and short, and fits beside it.
bool VirtualController::answer(UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data) {
  const std::array<std::uint8_t, lockstep::kUsbHeaderBytes> head{static_cast<std::uint8_t>(kind), address,
                                                                 static_cast<std::uint8_t>(data.size())};
  std::array<std::uint8_t, lockstep::kUsbRecordBytes> record;
  std::copy(data.begin(), data.end(), std::copy(head.begin(), head.end(), record.begin()));
  (void)bus_.from_board.write(std::span(record).first(head.size() + data.size()));
  return false;
}

void VirtualController::connect(bool is_connected) {
  reset();
  answer(is_connected ? UsbRecord::attach : UsbRecord::detach, 0);
}

bool VirtualController::open(std::uint8_t address, std::uint16_t packet_bytes) {
  const std::size_t number = address & kNumber;
  if (number >= kEndpoints || packet_bytes == 0 || packet_bytes > lockstep::kUsbPacketBytes) return false;
  pipes_[number][is_to_host(address) ? 1 : 0] = {.packet_bytes = packet_bytes};
  return true;
}

void VirtualController::close_all() {
  for (auto& both : std::span(pipes_).subspan(1)) both = {};
}

bool VirtualController::transfer(std::uint8_t address, std::uint8_t* data, std::uint16_t length) {
  Pipe* const pipe = find(address);
  if (pipe == nullptr || pipe->halted) return false;
  pipe->data = data;
  pipe->length = length;
  pipe->done = 0;
  pipe->armed = true;
  return true;
}

void VirtualController::stall(std::uint8_t address) {
  Pipe* const pipe = find(address);
  if (pipe == nullptr) return;
  pipe->armed = false;
  pipe->halted = true;
}

void VirtualController::clear_stall(std::uint8_t address) {
  Pipe* const pipe = find(address);
  if (pipe != nullptr) *pipe = {.packet_bytes = pipe->packet_bytes};
}

void VirtualController::wake_host() {
  answer(UsbRecord::wake, 0);
}

}  // namespace palpate::board

using palpate::board::the_controller;

extern "C" {

void dcd_init(std::uint8_t port) {
  dcd_connect(port);
}

// All of it runs in the background: there is no interrupt to keep out.
void dcd_int_handler(std::uint8_t) {}
void dcd_int_enable(std::uint8_t) {}
void dcd_int_disable(std::uint8_t) {}

void dcd_connect(std::uint8_t) {
  the_controller->connect(true);
}

void dcd_disconnect(std::uint8_t) {
  the_controller->connect(false);
}

void dcd_remote_wakeup(std::uint8_t) {
  the_controller->wake_host();
}

// There is one device on this bus, so its address does nothing; the status stage is the driver's.
void dcd_set_address(std::uint8_t, std::uint8_t) {
  the_controller->transfer(palpate::board::kToHost, nullptr, 0);
}

bool dcd_edpt_open(std::uint8_t, const tusb_desc_endpoint_t* endpoint) {
  return the_controller->open(endpoint->bEndpointAddress, tu_edpt_packet_size(endpoint));
}

void dcd_edpt_close_all(std::uint8_t) {
  the_controller->close_all();
}

bool dcd_edpt_xfer(std::uint8_t, std::uint8_t address, std::uint8_t* data, std::uint16_t length) {
  return the_controller->transfer(address, data, length);
}

void dcd_edpt_stall(std::uint8_t, std::uint8_t address) {
  the_controller->stall(address);
}

void dcd_edpt_clear_stall(std::uint8_t, std::uint8_t address) {
  the_controller->clear_stall(address);
}

}  // extern "C"
