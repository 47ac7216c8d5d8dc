// A link over a USB device's own interface: the first one of its vendor's class (0xFF) with a bulk endpoint
// each way. libusb-1.0; no driver of the kernel has the interface, and the device's configuration stays as it
// is.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "host/link/transport.hpp"

namespace palpate::link {

struct UsbAddress {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial{};  // empty: any
};

// VID:PID[,SERIAL], VID and PID hexadecimal with four digits. Throws TransportError.
UsbAddress parse_usb_address(std::string_view text);

// One frame a transfer; one that ends with a full packet has an empty packet behind it, so that the device
// sees its end. A device that is pulled out, or stalls an endpoint, is gone. Throws TransportError: no such
// device, several of them, no permission, another program has it, no such interface.
std::unique_ptr<Transport> open_usb(const UsbAddress& address);

// Waits until such a device is plugged in (its hot-plug event, and a look every 250 ms for systems that send
// none); false: not within `longest`. Throws TransportError: USB cannot be used at all.
bool wait_for_usb(const UsbAddress& address, std::chrono::milliseconds longest);

}  // namespace palpate::link
