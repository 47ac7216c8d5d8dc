#include "host/link/usb_device.hpp"

#include <gtest/gtest.h>

namespace palpate::link {
namespace {

TEST(UsbDevice, AddressesThereAndBack) {
  const UsbAddress any = parse_usb_address("1209:00aF");
  EXPECT_EQ(any.vendor, 0x1209);
  EXPECT_EQ(any.product, 0x00AF);
  EXPECT_EQ(any.serial, "");
  EXPECT_EQ(text_of(any), "usb:1209:00af");
  const UsbAddress one = parse_usb_address("1d50:606f,a,b:c");
  EXPECT_EQ(one.serial, "a,b:c");  // a serial may hold anything
  EXPECT_EQ(text_of(one), "usb:1d50:606f,a,b:c");
}

TEST(UsbDevice, RefusesWhatIsNoAddress) {
  for (const std::string_view text :
       {"", "1209", "1209:", ":0001", "1209:001", "1209:00001", "1209:-001", "0x12:0001", "1209 :0001"})
    EXPECT_THROW(parse_usb_address(text), TransportError) << text;
}

}  // namespace
}  // namespace palpate::link
