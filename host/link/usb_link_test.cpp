// Wants the device of hil_tests/test_linux_guest.py, PALPATE_TEST_USB: vendor 1209, product 0001, serial
// SN0001. It sends each frame back in reverse, once it has seen the frame's end; at "unplug" it is pulled out
// and plugged in again.
#include "host/link/usb_link.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "host/link/link_testing.hpp"

namespace palpate::link {
namespace {

using testing::Bytes;
using testing::counting;
using testing::kPatience;
using testing::message_of;
using testing::read_all;

Bytes reversed(Bytes bytes) {
  std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

class UsbLinkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("PALPATE_TEST_USB") == nullptr)
      GTEST_SKIP() << "PALPATE_TEST_USB is not set: no such device";
    ASSERT_TRUE(wait_for_usb(kAddress, kPatience));
  }
  inline static const UsbAddress kAddress{.vendor = 0x1209, .product = 0x0001, .serial = "SN0001"};
};

// Every one of them has its end, those that fill their last packet (512 bytes) too.
TEST_F(UsbLinkTest, FramesOfEveryLengthCrossBothWays) {
  const auto link = open_transport("usb:1209:0001");
  std::uint64_t total = 0;
  for (const std::size_t length :
       {1u, 63u, 64u, 65u, 511u, 512u, 513u, 1024u, 4096u, 16383u, 16384u, 16385u, 40960u}) {
    const Bytes frame = counting(length, static_cast<std::uint8_t>(length));
    ASSERT_TRUE(link->write(frame));
    ASSERT_EQ(read_all(*link, length), reversed(frame)) << length;
    total += length;
  }
  EXPECT_EQ(link->counters().bytes_sent, total);
  EXPECT_EQ(link->counters().bytes_received, total);
  EXPECT_EQ(link->counters().frames_unsent, 0u);
}

// More than the link holds for its reader: the device waits, nothing is lost.
TEST_F(UsbLinkTest, WhatNobodyReadsWaitsInOrder) {
  const auto link = open_transport("usb:1209:0001,SN0001");
  Bytes expected;
  for (std::uint8_t i = 0; i < 200; ++i) {
    const Bytes frame = counting(8000, i);
    // A machine that does other things may be slower than the link's patience: then the frame was not sent.
    while (link->is_open() && !link->write(frame)) continue;
    const Bytes answer = reversed(frame);
    expected.insert(expected.end(), answer.begin(), answer.end());
  }
  EXPECT_EQ(read_all(*link, expected.size()), expected);
}

TEST_F(UsbLinkTest, PulledOutItIsGoneAndCanBeOpenedAgain) {
  for (int time = 0; time < 3; ++time) {
    const auto link = open_usb(kAddress);
    constexpr std::string_view kUnplug = "unplug";
    ASSERT_TRUE(link->write(Bytes(kUnplug.begin(), kUnplug.end())));
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (link->is_open() && std::chrono::steady_clock::now() < end)
      link->read(std::chrono::milliseconds(10));
    EXPECT_FALSE(link->is_open());
    EXPECT_FALSE(link->write(counting(10)));
    EXPECT_GE(link->counters().frames_unsent, 1u);
    ASSERT_TRUE(wait_for_usb(kAddress, kPatience));
    const auto again = open_usb(kAddress);
    ASSERT_TRUE(again->write(counting(10)));
    EXPECT_EQ(read_all(*again, 10), reversed(counting(10)));
  }
}

TEST_F(UsbLinkTest, OneHostADevice) {
  auto first = open_usb(kAddress);
  EXPECT_EQ(first->address(), "usb:1209:0001,SN0001");
  EXPECT_NE(message_of(first->address()).find("another program or a driver has it"), std::string::npos);
  first.reset();
  EXPECT_EQ(message_of("usb:1209:0001"), "");
}

TEST_F(UsbLinkTest, SaysWhatIsNotThere) {
  EXPECT_EQ(message_of("usb:1209:0002"), "usb:1209:0002: no such device");
  EXPECT_EQ(message_of("usb:1209:0001,SN0002"),
            "usb:1209:0001,SN0002: 0 devices fit, 1 is needed; serials: SN0001");
  EXPECT_FALSE(wait_for_usb({.vendor = 0x1209, .product = 0x0002}, std::chrono::milliseconds(1)));
  EXPECT_FALSE(
      wait_for_usb({.vendor = 0x1209, .product = 0x0001, .serial = "SN0002"}, std::chrono::milliseconds(1)));
  // The guest's own hub has no interface for links.
  EXPECT_NE(message_of("usb:1d6b:0002").find("no interface of the vendor's class"), std::string::npos);
}

// A number for the report, no assertion.
TEST_F(UsbLinkTest, RoundTrips) {
  const auto link = open_usb(kAddress);
  for (const std::size_t length : {64u, 1484u}) {
    constexpr int kTrips = 500;
    const Bytes frame = counting(length), answer = reversed(frame);
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < kTrips; ++i) {
      ASSERT_TRUE(link->write(frame));
      ASSERT_EQ(read_all(*link, length), answer);
    }
    const std::chrono::duration<double> took_s = std::chrono::steady_clock::now() - start;
    std::printf("measured: usb, %zu bytes: %.0f round trips a second\n", length, kTrips / took_s.count());
  }
}

}  // namespace
}  // namespace palpate::link
