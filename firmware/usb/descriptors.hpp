// What the board says of itself on USB: a full-speed device of two functions, the vendor's own with one bulk
// endpoint each way, which Windows gives its driver WinUSB without being asked, and a serial line (CDC-ACM).
//
// Sources: USB 2.0, chapter 9; USB ECN "Interface Association Descriptor"; USB CDC 1.2 and PSTN 1.2;
// Microsoft OS 2.0 Descriptors Specification.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::firmware::usb {

inline constexpr std::uint16_t kVendorId = 0x1209;   // pid.codes
inline constexpr std::uint16_t kProductId = 0x0001;  // theirs for tests: not for a product
inline constexpr std::size_t kPacketBytes = 64;      // full speed, control and bulk

// Endpoint addresses
inline constexpr std::uint8_t kVendorOut = 0x01, kVendorIn = 0x81;
inline constexpr std::uint8_t kSerialOut = 0x02, kSerialIn = 0x82, kSerialNotification = 0x83;

enum class Interface : std::uint8_t { vendor, serial_control, serial_data, count };
enum class Text : std::uint8_t { languages, manufacturer, product, serial, vendor_function, serial_function };

// The vendor request that returns the Microsoft OS 2.0 descriptor set, and its wIndex.
inline constexpr std::uint8_t kMicrosoftRequest = 0x20;
inline constexpr std::uint16_t kMicrosoftDescriptorIndex = 7;

// Each begins with its own length, or its total length where the standard has one.
const std::uint8_t* device_descriptor();
const std::uint8_t* configuration_descriptor();
const std::uint8_t* object_store_descriptor();
struct MicrosoftDescriptors {
  const std::uint8_t* data;
  std::uint16_t length;
};
MicrosoftDescriptors microsoft_descriptors();
// Without the serial number, which is the chip's; nullptr: there is no such text.
const char* text(Text index);

}  // namespace palpate::firmware::usb
