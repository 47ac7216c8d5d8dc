#include "firmware/usb/descriptors.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace palpate::firmware::usb {
namespace {

constexpr std::uint8_t low(std::size_t value) {
  return static_cast<std::uint8_t>(value & 0xFF);
}
constexpr std::uint8_t high(std::size_t value) {
  return static_cast<std::uint8_t>(value >> 8 & 0xFF);
}
constexpr std::uint8_t of(Interface number) {
  return static_cast<std::uint8_t>(number);
}
constexpr std::uint8_t of(Text index) {
  return static_cast<std::uint8_t>(index);
}

template <class... Parts>
constexpr auto joined(const Parts&... parts) {
  std::array<std::uint8_t, (std::tuple_size_v<Parts> + ...)> all{};
  auto at = all.begin();
  ((at = std::copy(parts.begin(), parts.end(), at)), ...);
  return all;
}

constexpr std::uint8_t kDevice = 1, kConfiguration = 2, kInterface = 4, kEndpoint = 5, kAssociation = 11;
constexpr std::uint8_t kObjectStore = 15, kCapability = 16, kPlatform = 5, kClassInterface = 0x24;
constexpr std::uint8_t kVendorClass = 0xFF, kCommunications = 2, kCommunicationsData = 10;
constexpr std::uint8_t kAbstractControl = 2;  // subclass
constexpr std::uint8_t kBulk = 2, kInterrupt = 3;
constexpr std::uint8_t kNotificationBytes = 8, kNotificationInterval_ms = 16;
constexpr unsigned kCurrent_mA = 100;

constexpr std::array<std::uint8_t, 18> kDeviceDescriptor{
    18,
    kDevice,
    0x10,
    0x02,  // USB 2.1: the least that has a binary object store
    0xEF,
    2,
    1,  // functions of several interfaces, with associations
    kPacketBytes,
    low(kVendorId),
    high(kVendorId),
    low(kProductId),
    high(kProductId),
    0x00,
    0x01,
    of(Text::manufacturer),
    of(Text::product),
    of(Text::serial),
    1};

constexpr std::array<std::uint8_t, 7> endpoint(std::uint8_t address, std::uint8_t kind, std::uint16_t bytes,
                                               std::uint8_t interval) {
  return {7, kEndpoint, address, kind, low(bytes), high(bytes), interval};
}

constexpr auto kVendorFunction =
    joined(std::array<std::uint8_t, 9>{9, kInterface, of(Interface::vendor), 0, 2, kVendorClass, 0, 0,
                                       of(Text::vendor_function)},
           endpoint(kVendorOut, kBulk, kPacketBytes, 0), endpoint(kVendorIn, kBulk, kPacketBytes, 0));

constexpr auto kSerialFunction =
    joined(std::array<std::uint8_t, 8>{8, kAssociation, of(Interface::serial_control), 2, kCommunications,
                                       kAbstractControl, 0, of(Text::serial_function)},
           std::array<std::uint8_t, 9>{9, kInterface, of(Interface::serial_control), 0, 1, kCommunications,
                                       kAbstractControl, 0, of(Text::serial_function)},
           std::array<std::uint8_t, 5>{5, kClassInterface, 0x00, 0x20, 0x01},  // header: CDC 1.20
           std::array<std::uint8_t, 5>{5, kClassInterface, 0x01, 0x00,
                                       of(Interface::serial_data)},      // no call management
           std::array<std::uint8_t, 4>{4, kClassInterface, 0x02, 0x02},  // line coding and line state
           std::array<std::uint8_t, 5>{5, kClassInterface, 0x06, of(Interface::serial_control),
                                       of(Interface::serial_data)},  // union
           endpoint(kSerialNotification, kInterrupt, kNotificationBytes, kNotificationInterval_ms),
           std::array<std::uint8_t, 9>{9, kInterface, of(Interface::serial_data), 0, 2, kCommunicationsData,
                                       0, 0, 0},
           endpoint(kSerialOut, kBulk, kPacketBytes, 0), endpoint(kSerialIn, kBulk, kPacketBytes, 0));

constexpr std::size_t kConfigurationBytes = 9 + kVendorFunction.size() + kSerialFunction.size();
constexpr auto kConfigurationDescriptor =
    joined(std::array<std::uint8_t, 9>{9, kConfiguration, low(kConfigurationBytes), high(kConfigurationBytes),
                                       of(Interface::count), 1, 0, 0x80 /* from the bus */, kCurrent_mA / 2},
           kVendorFunction, kSerialFunction);

// Microsoft OS 2.0: the vendor's function alone is WinUSB's.
constexpr std::string_view kGuidName = "DeviceInterfaceGUIDs";
constexpr std::string_view kGuid = "{ED3D75E3-3B4A-4D6E-9375-BEC97AB0E882}";  // made for this interface
constexpr std::size_t kGuidNameBytes = 2 * (kGuidName.size() + 1);
constexpr std::size_t kGuidBytes = 2 * (kGuid.size() + 2);  // a list of texts ends with an empty one

template <std::size_t Bytes>
constexpr std::array<std::uint8_t, Bytes> utf16(std::string_view text) {
  std::array<std::uint8_t, Bytes> bytes{};
  for (std::size_t i = 0; i < text.size(); ++i) bytes[2 * i] = static_cast<std::uint8_t>(text[i]);
  return bytes;
}

constexpr std::array<std::uint8_t, 20> kCompatible{20, 0, 3, 0, 'W', 'I', 'N', 'U', 'S', 'B'};
constexpr std::size_t kPropertyBytes = 10 + kGuidNameBytes + kGuidBytes;
constexpr auto kProperty =
    joined(std::array<std::uint8_t, 8>{low(kPropertyBytes), high(kPropertyBytes), 4, 0, 7, 0 /* texts */,
                                       low(kGuidNameBytes), high(kGuidNameBytes)},
           utf16<kGuidNameBytes>(kGuidName), std::array<std::uint8_t, 2>{low(kGuidBytes), high(kGuidBytes)},
           utf16<kGuidBytes>(kGuid));
constexpr std::size_t kFunctionBytes = 8 + kCompatible.size() + kProperty.size();
constexpr std::size_t kSubsetBytes = 8 + kFunctionBytes;
constexpr std::size_t kSetBytes = 10 + kSubsetBytes;
constexpr std::array<std::uint8_t, 4> kWindows81{0x00, 0x00, 0x03, 0x06};  // the first that asks
constexpr auto kMicrosoftDescriptors = joined(
    std::array<std::uint8_t, 4>{10, 0, 0, 0}, kWindows81,
    std::array<std::uint8_t, 2>{low(kSetBytes), high(kSetBytes)},
    std::array<std::uint8_t, 8>{8, 0, 1, 0, 0 /* configuration */, 0, low(kSubsetBytes), high(kSubsetBytes)},
    std::array<std::uint8_t, 8>{8, 0, 2, 0, of(Interface::vendor), 0, low(kFunctionBytes),
                                high(kFunctionBytes)},
    kCompatible, kProperty);
static_assert(kMicrosoftDescriptors.size() == kSetBytes);

// Platform capability {D8DD60DF-4589-4CC7-9CD2-659D9E648A9F}
constexpr std::array<std::uint8_t, 20> kMicrosoftCapability{
    28,   kCapability, kPlatform, 0,    0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45,
    0xC7, 0x4C,        0x9C,      0xD2, 0x65, 0x9D, 0x9E, 0x64, 0x8A, 0x9F};
constexpr auto kObjectStoreDescriptor =
    joined(std::array<std::uint8_t, 5>{5, kObjectStore, 5 + 28, 0, 1}, kMicrosoftCapability, kWindows81,
           std::array<std::uint8_t, 4>{low(kSetBytes), high(kSetBytes), kMicrosoftRequest, 0});
static_assert(kObjectStoreDescriptor.size() == 5 + 28);

constexpr std::array<const char*, 6> kTexts{nullptr, "palpate",      "palpate haptic board",
                                            nullptr, "palpate link", "palpate serial line"};

}  // namespace

const std::uint8_t* device_descriptor() {
  return kDeviceDescriptor.data();
}
const std::uint8_t* configuration_descriptor() {
  return kConfigurationDescriptor.data();
}
const std::uint8_t* object_store_descriptor() {
  return kObjectStoreDescriptor.data();
}
MicrosoftDescriptors microsoft_descriptors() {
  return {kMicrosoftDescriptors.data(), kMicrosoftDescriptors.size()};
}
const char* text(Text index) {
  return of(index) < kTexts.size() ? kTexts[of(index)] : nullptr;
}

}  // namespace palpate::firmware::usb
