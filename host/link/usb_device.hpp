// libusb's objects with an owner each, and how a device is found.
#pragma once

#include <libusb-1.0/libusb.h>

#include <memory>
#include <string>
#include <vector>

#include "host/link/usb_link.hpp"

namespace palpate::link {

struct UsbContextEnd {
  void operator()(libusb_context* context) const { libusb_exit(context); }
};
struct UsbHandleEnd {
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
};
struct UsbDeviceEnd {
  void operator()(libusb_device* device) const { libusb_unref_device(device); }
};
struct UsbTransferEnd {
  void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};
using UsbContext = std::unique_ptr<libusb_context, UsbContextEnd>;
using UsbHandle = std::unique_ptr<libusb_device_handle, UsbHandleEnd>;
using UsbDevice = std::unique_ptr<libusb_device, UsbDeviceEnd>;
using UsbTransfer = std::unique_ptr<libusb_transfer, UsbTransferEnd>;

// "usb:VID:PID[,SERIAL]".
std::string text_of(const UsbAddress& address);

// A context sees the devices that are there when it is made, and later ones only where the system sends
// hot-plug events. Throws TransportError.
UsbContext make_usb_context(const std::string& address);

// All devices of vendor and product, whatever their serial.
std::vector<UsbDevice> usb_devices(libusb_context* context, const UsbAddress& address);

// Empty: it has none.
std::string usb_serial(libusb_device_handle* handle);

// The interface of a link and its endpoints; `in` is 0 where the device has none.
struct UsbInterface {
  int number = 0;
  std::uint8_t in = 0;
  std::uint8_t out = 0;
};
UsbInterface find_bulk_interface(libusb_device* device);

}  // namespace palpate::link
