#include "host/link/usb_device.hpp"

#include <array>
#include <charconv>
#include <cstdio>
#include <span>

namespace palpate::link {
namespace {

constexpr std::size_t kIdDigits = 4;

std::uint16_t id(std::string_view text, const char* what, std::string_view digits) {
  std::uint16_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (error != std::errc{} || end != digits.data() + digits.size() || digits.size() != kIdDigits)
    throw TransportError("usb:" + std::string(text) + ": " + what + " is '" + std::string(digits) +
                         "', allowed 4 hexadecimal digits");
  return value;
}

struct ListEnd {
  void operator()(libusb_device** list) const { libusb_free_device_list(list, 1); }
};
struct ConfigurationEnd {
  void operator()(libusb_config_descriptor* configuration) const {
    libusb_free_config_descriptor(configuration);
  }
};

}  // namespace

UsbAddress parse_usb_address(std::string_view text) {
  const std::size_t comma = text.find(',');
  const std::string_view ids = text.substr(0, comma);
  const std::size_t colon = ids.find(':');
  if (colon == std::string_view::npos)
    throw TransportError("usb:" + std::string(text) + ": allowed usb:VID:PID[,SERIAL]");
  return {.vendor = id(text, "VID", ids.substr(0, colon)),
          .product = id(text, "PID", ids.substr(colon + 1)),
          .serial = std::string(comma == std::string_view::npos ? "" : text.substr(comma + 1))};
}

std::string text_of(const UsbAddress& address) {
  std::array<char, sizeof "usb:0000:0000"> text{};
  std::snprintf(text.data(), text.size(), "usb:%04x:%04x", address.vendor, address.product);
  return text.data() + (address.serial.empty() ? "" : "," + address.serial);
}

UsbContext make_usb_context(const std::string& address) {
  libusb_context* context = nullptr;
  if (const int error = libusb_init(&context); error != 0)
    throw TransportError(address + ": USB: " + libusb_strerror(error));
  return UsbContext(context);
}

std::vector<UsbDevice> usb_devices(libusb_context* context, const UsbAddress& address) {
  std::vector<UsbDevice> found;
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(context, &list);
  if (count < 0) return found;
  const std::unique_ptr<libusb_device*, ListEnd> owner(list);
  for (libusb_device* device : std::span(list, static_cast<std::size_t>(count))) {
    libusb_device_descriptor descriptor{};
    libusb_get_device_descriptor(device, &descriptor);
    if (descriptor.idVendor == address.vendor && descriptor.idProduct == address.product)
      found.emplace_back(libusb_ref_device(device));
  }
  return found;
}

std::string usb_serial(libusb_device_handle* handle) {
  libusb_device_descriptor descriptor{};
  libusb_get_device_descriptor(libusb_get_device(handle), &descriptor);
  std::array<unsigned char, 256> text{};
  if (descriptor.iSerialNumber == 0) return "";
  const int length = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(),
                                                        static_cast<int>(text.size()));
  return length <= 0 ? "" : std::string(text.data(), text.data() + length);
}

UsbInterface find_bulk_interface(libusb_device* device) {
  libusb_config_descriptor* configuration = nullptr;
  if (libusb_get_active_config_descriptor(device, &configuration) != 0) return {};
  const std::unique_ptr<libusb_config_descriptor, ConfigurationEnd> owner(configuration);
  for (const libusb_interface& interface :
       std::span(configuration->interface, configuration->bNumInterfaces)) {
    if (interface.num_altsetting == 0 || interface.altsetting[0].bInterfaceClass != LIBUSB_CLASS_VENDOR_SPEC)
      continue;
    UsbInterface found{.number = interface.altsetting[0].bInterfaceNumber};
    for (const libusb_endpoint_descriptor& endpoint :
         std::span(interface.altsetting[0].endpoint, interface.altsetting[0].bNumEndpoints)) {
      if ((endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
      std::uint8_t& way = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0 ? found.in : found.out;
      if (way == 0) way = endpoint.bEndpointAddress;
    }
    if (found.in != 0 && found.out != 0) return found;
  }
  return {};
}

}  // namespace palpate::link
