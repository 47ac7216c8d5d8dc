#include "boards/stm32g4/usb_controller.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>

#include "boards/cortex_m/core_registers.hpp"
#include "boards/stm32g4/clock.hpp"
#include "boards/stm32g4/registers.hpp"
#include "boards/stm32g4/timebase.hpp"
#include "tusb_option.h"
// Behind the options that it reads.
#include "device/dcd.h"

namespace palpate::stm32g4 {
namespace {

constexpr std::uint8_t kPort = 0;
constexpr std::uint32_t kEndpoints = CFG_TUD_ENDPPOINT_MAX;
constexpr std::uint32_t kPacket_bytes = 64;
constexpr std::uint32_t kControllerEndpoints = 8;
constexpr std::uint8_t kToHost = 0x80, kNumber = 0x0F;
constexpr std::size_t kSetup_bytes = 8;

// EPnR.STAT and EP_TYPE.
constexpr std::uint32_t kDisabled = 0, kStall = 1, kNak = 2, kValid = 3;
constexpr std::uint32_t kBulk = 0, kControl = 1, kInterrupt = 3;
// COUNT_RX for a buffer of 64 bytes: two blocks of 32.
constexpr std::uint16_t kReceiveBuffer64 = 0x8400;
constexpr std::uint16_t kCount = 0x03FF;
// Transactions handled in one interrupt: one of each endpoint and direction.
constexpr std::uint32_t kTransactionsAtOnce = 2 * kEndpoints;

// Packet memory: places of bytes, which are even.
constexpr std::uint32_t kTable_bytes = 8 * kControllerEndpoints;
constexpr std::uint32_t buffer_place(std::uint32_t number, bool to_host) {
  return kTable_bytes + kPacket_bytes * (2 * number + (to_host ? 0 : 1));
}
static_assert(buffer_place(kEndpoints, true) <= 1024);

volatile std::uint16_t& half_word(std::uint32_t place) {
  return *reinterpret_cast<volatile std::uint16_t*>(kUsbPacketMemory_address + place);
}
struct TableEntry {
  std::uint32_t number;

  [[nodiscard]] volatile std::uint16_t& transmit_address() const { return half_word(8 * number); }
  [[nodiscard]] volatile std::uint16_t& transmit_count() const { return half_word(8 * number + 2); }
  [[nodiscard]] volatile std::uint16_t& receive_address() const { return half_word(8 * number + 4); }
  [[nodiscard]] volatile std::uint16_t& receive_count() const { return half_word(8 * number + 6); }
};

// An odd last byte is read as one, not with the byte behind it.
void write_packet(std::uint32_t place, const std::uint8_t* data, std::uint32_t bytes) {
  for (std::uint32_t i = 0; i < bytes; i += 2) {
    const std::uint32_t high = i + 1 < bytes ? data[i + 1] : 0u;
    half_word(place + i) = static_cast<std::uint16_t>(data[i] | (high << 8));
  }
}
void read_packet(std::uint32_t place, std::uint8_t* data, std::uint32_t bytes) {
  for (std::uint32_t i = 0; i < bytes; i += 2) {
    const std::uint16_t both = half_word(place + i);
    data[i] = static_cast<std::uint8_t>(both);
    if (i + 1 < bytes) data[i + 1] = static_cast<std::uint8_t>(both >> 8);
  }
}

Register& endpoint_register(std::uint32_t number) {
  return USB_FS_device[{usb::EP0R.bytes + 4 * number}];
}
constexpr std::uint32_t kHeld = usb::EP0R_EA | usb::EP0R_EP_KIND | usb::EP0R_EP_TYPE;
constexpr std::uint32_t kCleared = usb::EP0R_CTR_RX | usb::EP0R_CTR_TX;  // by 0

// Brings the bits that are changed by 1 to `wanted`.
void toggle_to(std::uint32_t number, std::uint32_t mask, std::uint32_t wanted) {
  Register& one = endpoint_register(number);
  const std::uint32_t now = one;
  one = (now & kHeld) | kCleared | ((now ^ wanted) & mask);
}
void set_status(std::uint32_t number, bool to_host, std::uint32_t status) {
  const Bits bits = to_host ? usb::EP0R_STAT_TX : usb::EP0R_STAT_RX;
  toggle_to(number, bits.mask(), bits.of(status));
}
void restart_toggle(std::uint32_t number, bool to_host) {
  toggle_to(number, (to_host ? usb::EP0R_DTOG_TX : usb::EP0R_DTOG_RX).mask(), 0);
}
void acknowledge(std::uint32_t number, Bits done) {
  Register& one = endpoint_register(number);
  one = (one & kHeld) | (kCleared & ~done.mask());
}

// A direction of an endpoint.
struct Pipe {
  std::uint8_t* data = nullptr;
  std::uint16_t length = 0;
  std::uint16_t done = 0;
  std::uint16_t on_its_way = 0;  // to the host, in the buffer
};
std::array<std::array<Pipe, 2>, kEndpoints> pipes;  // by number; [1] is to the host
// Taken over when the status stage has ended; 0: none is pending.
std::atomic<std::uint8_t> new_address{0};

Pipe& pipe_of(std::uint32_t number, bool to_host) {
  return pipes[number][to_host ? 1 : 0];
}

void send_packet(std::uint32_t number) {
  Pipe& pipe = pipe_of(number, true);
  pipe.on_its_way =
      static_cast<std::uint16_t>(std::min<std::uint32_t>(pipe.length - pipe.done, kPacket_bytes));
  write_packet(buffer_place(number, true), pipe.data + pipe.done, pipe.on_its_way);
  TableEntry{number}.transmit_count() = pipe.on_its_way;
  set_status(number, true, kValid);
}

// Sets a direction up: it answers NAK until there is a transfer.
void open_pipe(std::uint32_t number, bool to_host, std::uint32_t type) {
  pipe_of(number, to_host) = {};
  Register& one = endpoint_register(number);
  one = usb::EP0R_EP_TYPE.of(type) | usb::EP0R_EA.of(number) | kCleared;
  const auto place = static_cast<std::uint16_t>(buffer_place(number, to_host));
  const TableEntry entry{number};
  if (to_host) {
    entry.transmit_address() = place;
    entry.transmit_count() = 0;
  } else {
    entry.receive_address() = place;
    entry.receive_count() = kReceiveBuffer64;
  }
  restart_toggle(number, to_host);
  set_status(number, to_host, kNak);
}

void close_pipes(std::uint32_t from) {
  for (std::uint32_t number = from; number < kEndpoints; ++number) {
    for (const bool to_host : {false, true}) {
      set_status(number, to_host, kDisabled);
      pipe_of(number, to_host) = {};
    }
  }
}

void isr_reset() {
  clear(USB_FS_device[usb::CNTR], usb::CNTR_FSUSP);
  // A reset of the bus leaves the flags of what was done before it.
  for (std::uint32_t number = 0; number < kControllerEndpoints; ++number) {
    Register& one = endpoint_register(number);
    one = one & kHeld;
  }
  close_pipes(0);
  new_address.store(0, std::memory_order_relaxed);
  open_pipe(0, false, kControl);
  open_pipe(0, true, kControl);
  USB_FS_device[usb::DADDR] = usb::DADDR_EF.mask();
  dcd_event_bus_reset(kPort, TUSB_SPEED_FULL, true);
}

// The packet is read before it is acknowledged: until then the controller takes no other SETUP.
void isr_setup() {
  set_status(0, true, kNak);  // were the next packet of that transfer ready already
  std::array<std::uint8_t, kSetup_bytes> request;
  read_packet(buffer_place(0, false), request.data(), request.size());
  // It ends what was on its way; the controller answers NAK both ways from here on.
  pipe_of(0, false) = pipe_of(0, true) = {};
  acknowledge(0, usb::EP0R_CTR_RX);
  dcd_event_setup_received(kPort, request.data(), true);
}

void isr_received(std::uint32_t number) {
  Pipe& pipe = pipe_of(number, false);
  const std::uint32_t bytes = TableEntry{number}.receive_count() & kCount;
  const std::uint32_t taken = std::min<std::uint32_t>(bytes, pipe.length - pipe.done);
  // What the stack has no room for is lost.
  read_packet(buffer_place(number, false), pipe.data + pipe.done, taken);
  acknowledge(number, usb::EP0R_CTR_RX);
  pipe.done = static_cast<std::uint16_t>(pipe.done + taken);
  if (bytes == kPacket_bytes && pipe.done < pipe.length) {
    set_status(number, false, kValid);
    return;
  }
  dcd_event_xfer_complete(kPort, static_cast<std::uint8_t>(number), pipe.done, XFER_RESULT_SUCCESS, true);
}

void isr_sent(std::uint32_t number) {
  Pipe& pipe = pipe_of(number, true);
  acknowledge(number, usb::EP0R_CTR_TX);
  pipe.done = static_cast<std::uint16_t>(pipe.done + pipe.on_its_way);
  pipe.on_its_way = 0;
  if (number == 0) {
    // The host has the acknowledgement of its SET_ADDRESS; the next packet comes under the new one.
    const std::uint8_t address = new_address.exchange(0, std::memory_order_relaxed);
    if (address != 0) USB_FS_device[usb::DADDR] = usb::DADDR_EF | usb::DADDR_ADD.of(address);
  }
  if (pipe.done < pipe.length) {
    send_packet(number);
    return;
  }
  dcd_event_xfer_complete(kPort, static_cast<std::uint8_t>(number | kToHost), pipe.done, XFER_RESULT_SUCCESS,
                          true);
}

void isr_transactions() {
  for (std::uint32_t i = 0; i < kTransactionsAtOnce; ++i) {
    const std::uint32_t status = USB_FS_device[usb::ISTR];
    if ((status & usb::ISTR_CTR.mask()) == 0) return;
    const std::uint32_t number = status & usb::ISTR_EP_ID.mask();
    if (number >= kEndpoints) return;  // none that was opened
    const std::uint32_t flags = endpoint_register(number);
    // What was sent was sent before: on endpoint 0 nothing goes out between a packet that has come and us.
    if ((flags & usb::EP0R_CTR_TX.mask()) != 0) isr_sent(number);
    if ((flags & usb::EP0R_CTR_RX.mask()) == 0) continue;
    if ((flags & usb::EP0R_SETUP.mask()) != 0) {
      isr_setup();
    } else {
      isr_received(number);
    }
  }
}

// Flags are cleared by 0.
void clear_flag(Bits flag) {
  USB_FS_device[usb::ISTR] = ~flag.mask();
}

}  // namespace

void start_usb_controller() {
  start_usb_clock();
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_USBEN);
  set_priority(interrupt::USB_LP, kLinkPriority);
}

}  // namespace palpate::stm32g4

using namespace palpate::stm32g4;

extern "C" {

void usb_low_priority_handler() {
  dcd_int_handler(kPort);
}

void dcd_init(std::uint8_t port) {
  USB_FS_device[usb::CNTR] = usb::CNTR_FRES.mask();  // and no longer powered down
  Timebase::wait_us(1);
  USB_FS_device[usb::CNTR] = 0;
  USB_FS_device[usb::BTABLE] = 0;
  USB_FS_device[usb::ISTR] = 0;
  USB_FS_device[usb::CNTR] = usb::CNTR_RESETM | usb::CNTR_SUSPM | usb::CNTR_WKUPM | usb::CNTR_CTRM;
  dcd_connect(port);
}

void dcd_connect(std::uint8_t) {
  set(USB_FS_device[usb::BCDR], usb::BCDR_DPPU);
}

void dcd_disconnect(std::uint8_t) {
  clear(USB_FS_device[usb::BCDR], usb::BCDR_DPPU);
}

void dcd_int_enable(std::uint8_t) {
  asm volatile("" ::: "memory");
  enable_interrupt(interrupt::USB_LP);
}

void dcd_int_disable(std::uint8_t) {
  disable_interrupt(interrupt::USB_LP);
}

void dcd_int_handler(std::uint8_t) {
  const std::uint32_t status = USB_FS_device[usb::ISTR];
  if ((status & usb::ISTR_RESET.mask()) != 0) {
    clear_flag(usb::ISTR_RESET);
    isr_reset();
    return;
  }
  if ((status & usb::ISTR_WKUP.mask()) != 0) {
    clear(USB_FS_device[usb::CNTR], usb::CNTR_FSUSP);
    clear_flag(usb::ISTR_WKUP);
    dcd_event_bus_signal(kPort, DCD_EVENT_RESUME, true);
  }
  if ((status & usb::ISTR_SUSP.mask()) != 0) {
    set(USB_FS_device[usb::CNTR], usb::CNTR_FSUSP);
    clear_flag(usb::ISTR_SUSP);
    dcd_event_bus_signal(kPort, DCD_EVENT_SUSPEND, true);
  }
  isr_transactions();
}

// Takes effect when the acknowledgement, which is the driver's to give, has arrived.
void dcd_set_address(std::uint8_t port, std::uint8_t address) {
  new_address.store(address, std::memory_order_relaxed);
  dcd_edpt_xfer(port, kToHost, nullptr, 0);
}

bool dcd_edpt_open(std::uint8_t, const tusb_desc_endpoint_t* endpoint) {
  const std::uint32_t number = endpoint->bEndpointAddress & kNumber;
  if (number >= kEndpoints || tu_edpt_packet_size(endpoint) > kPacket_bytes) return false;
  if (endpoint->bmAttributes.xfer == TUSB_XFER_ISOCHRONOUS) return false;
  const Masked masked(interrupt::USB_LP);
  open_pipe(number, (endpoint->bEndpointAddress & kToHost) != 0,
            endpoint->bmAttributes.xfer == TUSB_XFER_BULK ? kBulk : kInterrupt);
  return true;
}

void dcd_edpt_close_all(std::uint8_t) {
  const Masked masked(interrupt::USB_LP);
  close_pipes(1);
}

bool dcd_edpt_xfer(std::uint8_t, std::uint8_t address, std::uint8_t* data, std::uint16_t length) {
  const std::uint32_t number = address & kNumber;
  const bool to_host = (address & kToHost) != 0;
  if (number >= kEndpoints) return false;
  const Masked masked(interrupt::USB_LP);
  pipe_of(number, to_host) = {.data = data, .length = length};
  if (to_host) {
    send_packet(number);
  } else {
    set_status(number, false, kValid);
  }
  return true;
}

void dcd_edpt_stall(std::uint8_t, std::uint8_t address) {
  const std::uint32_t number = address & kNumber;
  if (number >= kEndpoints) return;
  const Masked masked(interrupt::USB_LP);
  set_status(number, (address & kToHost) != 0, kStall);
}

// Also of an endpoint that was not halted: what was queued is dropped, and the toggle starts again.
void dcd_edpt_clear_stall(std::uint8_t, std::uint8_t address) {
  const std::uint32_t number = address & kNumber;
  const bool to_host = (address & kToHost) != 0;
  if (number >= kEndpoints) return;
  const Masked masked(interrupt::USB_LP);
  set_status(number, to_host, kNak);
  restart_toggle(number, to_host);
  pipe_of(number, to_host) = {};
}

}  // extern "C"
