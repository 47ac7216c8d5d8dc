// The link on USB: what crosses in the exchange is the bus (usb_record.hpp), and TinyUSB and the firmware's
// driver are between it and the link's rings (EmulatedBoard).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "boards/lockstep/usb_bus.hpp"
#include "boards/lockstep/virtual_controller.hpp"
#include "firmware/ports/ports.hpp"
#include "firmware/usb/usb_link.hpp"

namespace palpate::board {

class UsbWire {
 public:
  using Hardware = lockstep::UsbBus;

  UsbWire(firmware::LinkBuffers& link, Hardware& bus, const std::array<std::uint8_t, 16>& unique_id)
      : controller_(bus), usb_(link, unique_id) {}

  void begin() { usb_.begin(); }
  // Interrupt context.
  void isr_receive(std::span<const std::uint8_t> records) { controller_.isr_receive(records); }
  std::size_t isr_transmit(std::span<std::uint8_t> bytes) { return controller_.isr_transmit(bytes); }
  // A tick of the bus: what has come is answered as fast as a bus brings it, one transaction after the other.
  void poll_receive() {
    for (std::size_t i = 0; i < kUsbTransactionsPerTick; ++i) {
      const VirtualController::Step step = controller_.run_one();
      if (step == VirtualController::Step::none) break;
      if (step == VirtualController::Step::event) usb_.service();
    }
    usb_.tick();
  }
  void start_transmit() { usb_.service(); }

 private:
  VirtualController controller_;
  firmware::usb::UsbLink usb_;
};

}  // namespace palpate::board
