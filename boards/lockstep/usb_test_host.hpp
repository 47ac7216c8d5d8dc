// For tests: the host's end of the bus of usb_record.hpp, one transaction after the other, and a board's USB
// behind it that has nothing but its rings.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "boards/lockstep/usb_wire.hpp"

namespace palpate::board::test {

using Bytes = std::vector<std::uint8_t>;
using lockstep::UsbRecord;

struct Answer {
  UsbRecord kind;
  std::uint8_t address;
  Bytes data;
  bool operator==(const Answer&) const = default;
};

struct Request {
  std::uint8_t kind;
  std::uint8_t request;
  std::uint16_t value;
  std::uint16_t index;
  std::uint16_t length;
};

inline constexpr std::uint8_t kDeviceIn = 0x80, kDeviceOut = 0x00, kEndpointOut = 0x02, kEndpointIn = 0x82;
inline constexpr std::uint8_t kClassOut = 0x21, kVendorDeviceIn = 0xC0;
inline constexpr std::uint8_t kGetStatus = 0, kClearFeature = 1, kSetFeature = 3, kSetAddress = 5;
inline constexpr std::uint8_t kGetDescriptor = 6, kGetConfiguration = 8, kSetConfiguration = 9;
inline constexpr std::uint8_t kSetLineCoding = 0x20, kSetLineState = 0x22;
inline constexpr std::size_t kMostRetries = 100;

class UsbTest : public ::testing::Test {
 protected:
  // TinyUSB is one in a program, so its board is, too.
  struct Rig {
    firmware::LinkBuffers link;
    lockstep::UsbBus bus;
    UsbWire wire{link, bus, {0xAB, 0xCD, 1}};
  };
  static Rig& rig() {
    static Rig the_rig;
    return the_rig;
  }

  void SetUp() override {
    static const bool begun = [] {
      rig().wire.begin();
      EXPECT_EQ(heard(), (std::vector<Answer>{{UsbRecord::attach, 0, {}}}));
      return true;
    }();
    ASSERT_TRUE(begun);
    tick({record(UsbRecord::unplug)});
    tick({record(UsbRecord::reset)});
    Bytes rest(4096);
    rig().link.received.read(rest);
    heard();
  }

  static Bytes record(UsbRecord kind, std::uint8_t address = 0, const Bytes& data = {}) {
    Bytes bytes{static_cast<std::uint8_t>(kind), address, static_cast<std::uint8_t>(data.size())};
    bytes.insert(bytes.end(), data.begin(), data.end());
    return bytes;
  }

  // One tick of the board, with these records; returns its answers.
  std::vector<Answer> tick(const std::vector<Bytes>& records = {}) {
    Bytes all = record(UsbRecord::frame);
    for (const Bytes& one : records) all.insert(all.end(), one.begin(), one.end());
    rig().wire.isr_receive(all);
    rig().wire.poll_receive();
    rig().wire.start_transmit();
    return heard();
  }

  static std::vector<Answer> heard() {
    Bytes bytes(8192);
    bytes.resize(rig().wire.isr_transmit(bytes));
    std::vector<Answer> answers;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto data = bytes.begin() + static_cast<std::ptrdiff_t>(at + lockstep::kUsbHeaderBytes);
      const std::size_t length = bytes[at + 2];
      answers.push_back({static_cast<UsbRecord>(bytes[at]), bytes[at + 1],
                         Bytes(data, data + static_cast<std::ptrdiff_t>(length))});
      at += lockstep::kUsbHeaderBytes + length;
    }
    return answers;
  }

  Answer transact(UsbRecord kind, std::uint8_t address, const Bytes& data = {}) {
    const bool is_out = kind == UsbRecord::out_data0 || kind == UsbRecord::out_data1;
    // Alone, so that each one begins again where one was refused.
    const auto token = static_cast<std::uint8_t>(address | (is_out ? lockstep::kUsbAgain : 0));
    const std::vector<Answer> answers = tick({record(kind, token, data)});
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? Answer{UsbRecord::silence, address, {}} : answers[0];
  }
  Answer in(std::uint8_t address) { return transact(UsbRecord::in, address); }

  // A control transfer; nothing: it stalled.
  std::optional<Bytes> control(const Request& setup, const Bytes& data = {}) {
    const auto both = [](std::uint16_t value) {
      return std::array{static_cast<std::uint8_t>(value & 0xFF), static_cast<std::uint8_t>(value >> 8)};
    };
    Bytes bytes{setup.kind, setup.request};
    for (const std::uint16_t value : {setup.value, setup.index, setup.length})
      for (const std::uint8_t byte : both(value)) bytes.push_back(byte);
    EXPECT_EQ(transact(UsbRecord::setup, 0, bytes).kind, UsbRecord::ack);
    Bytes answer;
    bool odd = true;
    if ((setup.kind & 0x80) != 0) {
      for (bool more = setup.length != 0; more;) {
        const Answer packet = in(0x80);
        if (packet.kind == UsbRecord::stall) return std::nullopt;
        EXPECT_EQ(packet.kind, odd ? UsbRecord::data1 : UsbRecord::data0);
        odd = !odd;
        answer.insert(answer.end(), packet.data.begin(), packet.data.end());
        more = packet.data.size() == 64 && answer.size() < setup.length;
      }
      const Answer status = transact(UsbRecord::out_data1, 0);
      if (status.kind == UsbRecord::stall) return std::nullopt;
      EXPECT_EQ(status.kind, UsbRecord::ack);
      return answer;
    }
    if (!data.empty()) {
      const Answer sent = transact(UsbRecord::out_data1, 0, data);
      if (sent.kind == UsbRecord::stall) return std::nullopt;
      EXPECT_EQ(sent.kind, UsbRecord::ack);
    }
    const Answer status = in(0x80);
    if (status.kind == UsbRecord::stall) return std::nullopt;
    EXPECT_EQ(status, (Answer{UsbRecord::data1, 0x80, {}}));
    return answer;
  }
  std::optional<Bytes> descriptor(std::uint8_t kind, std::uint8_t index, std::uint16_t length = 255) {
    return control({kDeviceIn, kGetDescriptor, static_cast<std::uint16_t>(kind << 8 | index), 0, length});
  }
  std::string text(std::uint8_t index) {
    const Bytes bytes = descriptor(3, index).value();
    std::string all;
    for (std::size_t i = 2; i < bytes.size(); i += 2) all += static_cast<char>(bytes[i]);
    return all;
  }

  void configure() {
    ASSERT_TRUE(control({kDeviceOut, kSetAddress, 1, 0, 0}));
    ASSERT_TRUE(control({kDeviceOut, kSetConfiguration, 1, 0, 0}));
  }
  void set_line_state(bool is_open) {
    ASSERT_TRUE(control({kClassOut, kSetLineState, static_cast<std::uint16_t>(is_open ? 3 : 0), 1, 0}));
  }
  // Takes the packet without bytes that waits for a reader.
  void open_vendor() {
    const Answer first = in(firmware::usb::kVendorIn);
    ASSERT_EQ(first, (Answer{UsbRecord::data0, firmware::usb::kVendorIn, {}}));
  }

  // What the firmware says, in its background.
  void say(const Bytes& bytes) {
    ASSERT_TRUE(rig().link.transmit.write(bytes));
    rig().wire.start_transmit();
  }
  // As a frame: between delimiters, without others.
  static Bytes frame(std::size_t length, std::uint8_t first = 1) {
    Bytes bytes(length);
    for (std::size_t i = 1; i + 1 < length; ++i) bytes[i] = static_cast<std::uint8_t>((first + i) % 255 + 1);
    return bytes;
  }
  void expect_toggles_to_begin_again() {
    using firmware::usb::kVendorIn;
    received();
    EXPECT_EQ(transact(UsbRecord::out_data0, firmware::usb::kVendorOut, frame(12)).kind, UsbRecord::ack);
    EXPECT_EQ(received(), frame(12));
    say(frame(13));
    tick();
    EXPECT_EQ(in(kVendorIn), (Answer{UsbRecord::data0, kVendorIn, frame(13)}));
  }
  Bytes received() {
    Bytes bytes(4096);
    bytes.resize(rig().link.received.read(bytes));
    rig().wire.start_transmit();
    return bytes;
  }
  // Sizes of the packets of one transfer, and its bytes.
  Bytes read_transfer(std::uint8_t address, std::vector<std::size_t>* sizes = nullptr) {
    Bytes bytes;
    for (std::size_t tries = 0; tries < kMostRetries; ++tries) {
      const Answer packet = in(address);
      if (packet.kind == UsbRecord::nak) continue;
      if (sizes != nullptr) sizes->push_back(packet.data.size());
      bytes.insert(bytes.end(), packet.data.begin(), packet.data.end());
      if (packet.data.size() < lockstep::kUsbPacketBytes) return bytes;
    }
    ADD_FAILURE() << "no end of a transfer";
    return bytes;
  }
};

}  // namespace palpate::board::test
