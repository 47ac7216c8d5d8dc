// A build chooses by its include path what carries the link: here, the part's USB device on PA11 and PA12,
// which need no setting: the controller takes them when it is on.
#pragma once

#include <array>
#include <cstdint>

#include "boards/stm32g4/usb_controller.hpp"
#include "firmware/ports/ports.hpp"
#include "firmware/usb/usb_link.hpp"

namespace palpate::board {

class BoardWire {
 public:
  BoardWire(firmware::LinkBuffers& link, const std::array<std::uint8_t, 16>& unique_id)
      : usb_(link, unique_id) {}

  void begin() {
    stm32g4::start_usb_controller();
    usb_.begin();
  }
  // Once after each servo tick.
  void poll_receive() {
    usb_.service();
    usb_.tick();
  }
  void start_transmit() { usb_.service(); }
  void idle() { usb_.service(); }
  // The controller has reported something since.
  [[nodiscard]] bool has_work() const { return firmware::usb::UsbLink::has_work(); }

 private:
  firmware::usb::UsbLink usb_;
};

}  // namespace palpate::board
