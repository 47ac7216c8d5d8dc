// TinyUSB, the firmware's driver and the virtual controller, driven by a host model packet by packet.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>

#include "boards/lockstep/usb_test_host.hpp"
#include "firmware/usb/descriptors.hpp"

namespace palpate::board::test {
namespace {

using firmware::usb::kMicrosoftDescriptorIndex;
using firmware::usb::kMicrosoftRequest;
using firmware::usb::kPatience_ticks;
using firmware::usb::kSerialIn;
using firmware::usb::kSerialOut;
using firmware::usb::kVendorIn;
using firmware::usb::kVendorOut;

std::size_t two_bytes(const Bytes& bytes, std::size_t at) {
  return bytes[at] | static_cast<std::size_t>(bytes[at + 1]) << 8;
}

// Enumeration

TEST_F(UsbTest, TellsWhoItIs) {
  const Bytes device = descriptor(1, 0).value();
  ASSERT_EQ(device.size(), 18u);
  EXPECT_EQ(two_bytes(device, 8), 0x1209u);
  EXPECT_EQ(two_bytes(device, 10), 0x0001u);
  EXPECT_EQ(descriptor(1, 0, 8).value(), Bytes(device.begin(), device.begin() + 8));
  EXPECT_EQ(descriptor(3, 0).value(), (Bytes{4, 3, 0x09, 0x04}));
  EXPECT_EQ(text(device[14]), "palpate");
  EXPECT_EQ(text(device[15]), "palpate haptic board");
  EXPECT_EQ(text(device[16]), "abcd0100000000000000000000000000");
}

// Each descriptor's length leads to the next; interfaces are counted, endpoints are told apart.
TEST_F(UsbTest, TheConfigurationIsWellFormed) {
  const Bytes all = descriptor(2, 0).value();
  ASSERT_EQ(two_bytes(all, 2), all.size());
  std::vector<std::uint8_t> interfaces, endpoints;
  for (std::size_t at = 0; at < all.size(); at += all[at]) {
    ASSERT_GE(all[at], 2);
    ASSERT_LE(at + all[at], all.size());
    if (all[at + 1] == 4) interfaces.push_back(all[at + 2]);
    if (all[at + 1] == 5) endpoints.push_back(all[at + 2]);
  }
  EXPECT_EQ(interfaces, (std::vector<std::uint8_t>{0, 1, 2}));
  EXPECT_EQ(interfaces.size(), all[4]);
  EXPECT_EQ(endpoints, (std::vector<std::uint8_t>{kVendorOut, kVendorIn, 0x83, kSerialOut, kSerialIn}));
}

// What Windows asks: the object store, its platform capability, and with the request of that the set.
TEST_F(UsbTest, WindowsFindsItsDriver) {
  const Bytes store = descriptor(15, 0).value();
  ASSERT_EQ(store.size(), 33u);
  EXPECT_EQ(two_bytes(store, 2), store.size());
  EXPECT_EQ(store[31], kMicrosoftRequest);
  const std::size_t length = two_bytes(store, 29);
  const Request ask{kVendorDeviceIn, kMicrosoftRequest, 0, kMicrosoftDescriptorIndex, 255};
  const Bytes set = control(ask).value();
  ASSERT_EQ(set.size(), length);
  ASSERT_EQ(two_bytes(set, 8), length);
  // Header 10, then configuration, function, compatible identifier and property, one within the other.
  EXPECT_EQ(two_bytes(set, 10 + 6), length - 10);
  EXPECT_EQ(two_bytes(set, 18 + 6), length - 18);
  EXPECT_EQ(set[18 + 4], 0);  // the vendor's interface
  EXPECT_EQ(std::string(set.begin() + 30, set.begin() + 36), "WINUSB");
  EXPECT_EQ(two_bytes(set, 46), length - 46);
  const std::size_t name_length = two_bytes(set, 46 + 6);
  EXPECT_EQ(46 + 8 + name_length + 2 + two_bytes(set, 54 + name_length), length);
  EXPECT_EQ(set[54], 'D');
  EXPECT_EQ(set[54 + name_length + 2], '{');
}

TEST_F(UsbTest, WhatItDoesNotKnowStallsAndTheNextRequestIsAnswered) {
  configure();
  const Request unknown[] = {
      {kDeviceIn, 0x55, 0, 0, 4},                       // standard request
      {kVendorDeviceIn, 0x55, 0, 0, 4},                 // vendor's
      {kVendorDeviceIn, kMicrosoftRequest, 0, 6, 4},    // its index
      {0x40, kMicrosoftRequest, 0, 7, 0},               // its direction
      {kDeviceIn, kGetDescriptor, 6 << 8, 0, 10},       // device qualifier: full speed alone
      {kDeviceIn, kGetDescriptor, 3 << 8 | 9, 0, 255},  // text
      {kDeviceIn, kGetDescriptor, 2 << 8 | 1, 0, 9},    // configuration
      {kDeviceOut, kSetFeature, 2, 0, 0},               // test mode
      {0xA1, 0x99, 0, 1, 4},                            // class
      {0xA1, 0x21, 0, 9, 7},                            // interface
      {kEndpointIn, kGetStatus, 0, 0x85, 2},            // endpoint
      {kEndpointOut, kClearFeature, 0, 0x05, 0},
      {0x62, 0x55, 0, 0, 0},  // type that does not exist
  };
  for (const Request& setup : unknown) {
    EXPECT_EQ(control(setup), std::nullopt) << int{setup.kind} << " " << int{setup.request};
    EXPECT_EQ(descriptor(1, 0, 18).value().size(), 18u);
  }
  EXPECT_EQ(control({kDeviceOut, kSetConfiguration, 2, 0, 0}), std::nullopt);
  // With data: they were written over the answer, which is gone by then (found by fuzzing).
  for (const std::uint8_t request : {kGetStatus, kGetConfiguration, kGetDescriptor})
    EXPECT_EQ(control({kDeviceOut, request, 1 << 8, 0, 2}, {1, 2}), std::nullopt) << int{request};
  EXPECT_EQ(descriptor(1, 0, 18).value().size(), 18u);
}

TEST_F(UsbTest, ConfigurationIsTakenAndGivenBack) {
  const auto configuration = [&] { return control({kDeviceIn, kGetConfiguration, 0, 0, 1}).value(); };
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::silence);
  EXPECT_EQ(configuration(), Bytes{0});
  configure();
  EXPECT_EQ(configuration(), Bytes{1});
  EXPECT_EQ(control({kDeviceIn, kGetStatus, 0, 0, 2}).value(), (Bytes{0, 0}));
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::data0);
  EXPECT_TRUE(control({kDeviceOut, kSetConfiguration, 0, 0, 0}));
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::silence);
  configure();
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::data0);
}

TEST_F(UsbTest, LineCodingIsKeptAndALongerOneCut) {
  configure();
  const Bytes coding{0x00, 0xC2, 0x01, 0x00, 0, 0, 8};
  EXPECT_TRUE(control({kClassOut, kSetLineCoding, 0, 1, 7}, coding));
  EXPECT_EQ(control({0xA1, 0x21, 0, 1, 7}).value(), coding);
  Bytes longer(64, 0x11);
  std::copy(coding.begin(), coding.end(), longer.begin());
  (void)control({kClassOut, kSetLineCoding, 0, 1, 64}, longer);
  EXPECT_EQ(control({0xA1, 0x21, 0, 1, 7}).value(), coding);
}

// From the host

TEST_F(UsbTest, BytesFromTheHostReachTheRing) {
  configure();
  UsbRecord toggle = UsbRecord::out_data0;
  for (const std::size_t length : {1u, 63u, 64u, 0u, 5u}) {
    Bytes data = frame(length);
    EXPECT_EQ(transact(toggle, kVendorOut, data).kind, UsbRecord::ack);
    EXPECT_EQ(received(), data);
    toggle = toggle == UsbRecord::out_data0 ? UsbRecord::out_data1 : UsbRecord::out_data0;
  }
}

// An acknowledgement that was lost: the host sends the packet again.
TEST_F(UsbTest, APacketThatComesTwiceIsTakenOnce) {
  configure();
  const Bytes data = frame(20);
  EXPECT_EQ(transact(UsbRecord::out_data0, kVendorOut, data).kind, UsbRecord::ack);
  EXPECT_EQ(transact(UsbRecord::out_data0, kVendorOut, data).kind, UsbRecord::ack);
  EXPECT_EQ(received(), data);
  EXPECT_EQ(transact(UsbRecord::out_data1, kVendorOut, data).kind, UsbRecord::ack);
  EXPECT_EQ(received(), data);
}

// Nobody empties the ring: the host keeps what does not fit, and nothing is lost or swapped.
TEST_F(UsbTest, AFullRingMakesTheHostWait) {
  configure();
  Bytes sent, got;
  std::size_t refused = 0;
  unsigned toggle = 0;
  for (std::size_t i = 0; i < 100; ++i) {
    const Bytes packet = frame(64, static_cast<std::uint8_t>(i));
    const auto kind = [&] { return toggle == 0 ? UsbRecord::out_data0 : UsbRecord::out_data1; };
    while (transact(kind(), kVendorOut, packet).kind == UsbRecord::nak) {
      ++refused;
      ASSERT_LE(rig().link.received.free(), 64u);
      const Bytes some = received();
      got.insert(got.end(), some.begin(), some.end());
    }
    toggle ^= 1u;
    sent.insert(sent.end(), packet.begin(), packet.end());
  }
  const Bytes rest = received();
  got.insert(got.end(), rest.begin(), rest.end());
  EXPECT_EQ(got, sent);
  EXPECT_GE(refused, 1u);
}

// Of several packets those behind the one that was refused are refused, too, in later ticks as well, up to
// the one with which the host begins again.
TEST_F(UsbTest, PacketsBehindARefusedOneKeepTheirOrder) {
  configure();
  ASSERT_TRUE(rig().link.received.write(Bytes(4096 - 100)));
  const auto kind = [](std::size_t i) { return i % 2 == 0 ? UsbRecord::out_data0 : UsbRecord::out_data1; };
  std::vector<Bytes> records;
  for (std::size_t i = 0; i < 6; ++i) records.push_back(record(kind(i), kVendorOut, frame(64)));
  std::vector<UsbRecord> kinds;
  for (const Answer& answer : tick(records)) kinds.push_back(answer.kind);
  const auto first = std::find(kinds.begin(), kinds.end(), UsbRecord::nak);
  EXPECT_EQ(first - kinds.begin(), 2);  // one in the ring, one before it
  EXPECT_EQ(std::count(first, kinds.end(), UsbRecord::nak), 4);
  received();
  EXPECT_EQ(tick().size(), 0u);
  const std::vector<Answer> late = tick({record(kind(6), kVendorOut, frame(64, 9))});
  ASSERT_EQ(late.size(), 1u);
  EXPECT_EQ(late[0].kind, UsbRecord::nak);
  EXPECT_EQ(transact(kind(2), kVendorOut, frame(64)).kind, UsbRecord::ack);
}

// What the host does not acknowledge is kept for its next token, with its toggle.
TEST_F(UsbTest, APacketThatIsNotAcknowledgedComesAgain) {
  configure();
  open_vendor();
  say(frame(100));
  const auto unheard = static_cast<std::uint8_t>(kVendorIn | lockstep::kUsbUnheard);
  const auto answers = tick({record(UsbRecord::in, unheard), record(UsbRecord::in, unheard),
                             record(UsbRecord::in, kVendorIn), record(UsbRecord::in, kVendorIn)});
  ASSERT_EQ(answers.size(), 4u);
  EXPECT_EQ(answers[0].kind, UsbRecord::data1);
  EXPECT_EQ(answers[1], answers[0]);
  EXPECT_EQ(answers[2], answers[0]);
  EXPECT_EQ(answers[3].kind, UsbRecord::data0);
  Bytes all = answers[2].data;
  all.insert(all.end(), answers[3].data.begin(), answers[3].data.end());
  EXPECT_EQ(all, frame(100));
}

// What nobody has taken is counted, frame by frame: of those that a reader has begun the rest, and the one
// whose end waits in the endpoint.
TEST_F(UsbTest, FramesThatNobodyTakesAreCounted) {
  configure();
  open_vendor();
  const std::uint32_t before = rig().link.frames_unsent;
  say(frame(100));
  say(frame(90, 3));
  say(frame(80, 5));
  tick();
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);
  tick({record(UsbRecord::unplug)});
  tick();
  EXPECT_EQ(rig().link.frames_unsent - before, 3u);
  tick({record(UsbRecord::reset)});
}

// To the host

TEST_F(UsbTest, OneFrameIsOneTransfer) {
  configure();
  open_vendor();
  for (const std::size_t length : {10u, 63u, 64u, 65u, 127u, 128u, 129u, 1484u}) {
    say(frame(length));
    say(frame(20));
    std::vector<std::size_t> sizes;
    EXPECT_EQ(read_transfer(kVendorIn, &sizes), frame(length)) << length;
    EXPECT_EQ(sizes.size(), length / 64 + 1) << length;
    EXPECT_EQ(sizes.back(), length % 64) << length;
    EXPECT_EQ(read_transfer(kVendorIn), frame(20));
  }
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::nak);
}

TEST_F(UsbTest, ABusCarriesAThousandBytesATick) {
  configure();
  open_vendor();
  say(frame(1000));
  std::size_t bytes = 0;
  for (const Answer& answer : tick(std::vector<Bytes>(16, record(UsbRecord::in, kVendorIn))))
    bytes += answer.data.size();
  EXPECT_EQ(bytes, 1000u);
}

TEST_F(UsbTest, WhoComesLateMissesWholeFrames) {
  configure();
  for (int i = 0; i < 200; ++i) {
    say(frame(100));  // never full: nobody listens
    tick();
  }
  say(frame(70));
  tick();
  open_vendor();
  say(frame(90, 7));
  EXPECT_EQ(read_transfer(kVendorIn), frame(90, 7));
}

// The packet that waits when a reader goes is still there when the next one comes: the end of a frame is not.
TEST_F(UsbTest, AReaderThatGoesIsNoticed) {
  configure();
  open_vendor();
  say(frame(200));
  tick();
  for (std::uint32_t i = 2; i < kPatience_ticks; ++i) {  // after the tick above
    tick();
    EXPECT_EQ(rig().link.transmit.size(), 200u - 64u) << i;
  }
  tick();
  EXPECT_EQ(rig().link.transmit.size(), 0u);
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);
  say(frame(30));
  EXPECT_EQ(read_transfer(kVendorIn), frame(30));
}

// Who carries the link

TEST_F(UsbTest, TheSerialLineIsOpenedByItsLineState) {
  configure();
  set_line_state(true);
  const Bytes all = frame(300);
  say(all);
  Bytes got;
  for (std::size_t i = 0; i < kMostRetries && got.size() < all.size(); ++i) {
    const Answer packet = in(kSerialIn);
    got.insert(got.end(), packet.data.begin(), packet.data.end());
  }
  EXPECT_EQ(got, all);
  EXPECT_EQ(transact(UsbRecord::out_data0, kSerialOut, frame(10)).kind, UsbRecord::ack);
  EXPECT_EQ(received(), frame(10));
  // Closed: the vendor's function has it again, for who comes.
  set_line_state(false);
  say(frame(50));
  tick();
  EXPECT_EQ(rig().link.transmit.size(), 0u);
  open_vendor();
  say(frame(50));
  EXPECT_EQ(read_transfer(kVendorIn), frame(50));
}

TEST_F(UsbTest, TheOneThatWasOpenedLastCarriesTheLink) {
  configure();
  open_vendor();
  say(frame(200));
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);
  set_line_state(true);
  // Neither gets half of a frame: the serial line begins with the next one.
  tick();
  say(frame(40));
  EXPECT_EQ(read_transfer(kSerialIn), frame(40));
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);  // was in the endpoint already
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::nak);
  // What the host sends decides, too.
  EXPECT_EQ(transact(UsbRecord::out_data0, kVendorOut, frame(10)).kind, UsbRecord::ack);
  say(frame(30));
  EXPECT_EQ(read_transfer(kVendorIn), frame(30));
  EXPECT_EQ(transact(UsbRecord::out_data0, kSerialOut, frame(10)).kind, UsbRecord::ack);
  say(frame(31));
  EXPECT_EQ(read_transfer(kSerialIn), frame(31));
}

// Faults of the bus

TEST_F(UsbTest, AHaltIsToldAndCleared) {
  configure();
  open_vendor();
  const auto halted = [&](std::uint8_t address) {
    return control({kEndpointIn, kGetStatus, 0, address, 2}).value()[0] == 1;
  };
  EXPECT_EQ(transact(UsbRecord::out_data0, kVendorOut, frame(10)).kind, UsbRecord::ack);
  for (const std::uint8_t address : {kVendorIn, kVendorOut}) {
    EXPECT_TRUE(control({kEndpointOut, kSetFeature, 0, address, 0}));
    EXPECT_TRUE(halted(address));
    EXPECT_EQ(transact(address == kVendorIn ? UsbRecord::in : UsbRecord::out_data1, address).kind,
              UsbRecord::stall);
    EXPECT_TRUE(control({kEndpointOut, kClearFeature, 0, address, 0}));
    EXPECT_FALSE(halted(address));
  }
  expect_toggles_to_begin_again();
}

// As libusb_clear_halt() does at the beginning of many programs.
TEST_F(UsbTest, ClearingAHaltThatIsNoneBeginsTheTogglesAgain) {
  configure();
  EXPECT_EQ(transact(UsbRecord::out_data0, kVendorOut, frame(10)).kind, UsbRecord::ack);
  open_vendor();
  for (const std::uint8_t address : {kVendorIn, kVendorOut})
    EXPECT_TRUE(control({kEndpointOut, kClearFeature, 0, address, 0}));
  expect_toggles_to_begin_again();
}

TEST_F(UsbTest, HaltingEndpoint0DoesNothing) {
  configure();
  for (const std::uint8_t request : {kSetFeature, kClearFeature})
    EXPECT_TRUE(control({kEndpointOut, request, 0, 0, 0}));
  EXPECT_EQ(descriptor(1, 0, 18).value().size(), 18u);
}

TEST_F(UsbTest, AResetWithinATransferLeavesNothingOfIt) {
  configure();
  open_vendor();
  say(frame(300));
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);
  EXPECT_EQ(transact(UsbRecord::setup, 0, {kDeviceIn, kGetDescriptor, 0, 2, 0, 0, 98, 0}).kind,
            UsbRecord::ack);
  tick({record(UsbRecord::reset)});
  EXPECT_EQ(in(0x80).kind, UsbRecord::nak);
  EXPECT_EQ(in(kVendorIn).kind, UsbRecord::silence);
  configure();
  open_vendor();
  say(frame(40));
  EXPECT_EQ(read_transfer(kVendorIn), frame(40));
}

TEST_F(UsbTest, ASuspendedBusIsNotSpokenTo) {
  configure();
  open_vendor();
  say(frame(300));
  tick();
  tick({record(UsbRecord::suspend)});
  say(frame(50));
  tick();
  EXPECT_EQ(rig().link.transmit.size(), 0u);
  tick({record(UsbRecord::resume)});
  EXPECT_EQ(in(kVendorIn).data.size(), 64u);
  say(frame(60));
  EXPECT_EQ(read_transfer(kVendorIn), frame(60));
}

TEST_F(UsbTest, PulledOutAndPluggedInAgain) {
  for (int time = 0; time < 3; ++time) {
    configure();
    open_vendor();
    say(frame(300));
    EXPECT_EQ(in(kVendorIn).data.size(), 64u);
    tick({record(UsbRecord::unplug)});
    say(frame(30));
    tick();
    EXPECT_EQ(rig().link.transmit.size(), 0u);
    EXPECT_EQ(in(kVendorIn).kind, UsbRecord::silence);
    tick({record(UsbRecord::reset)});
  }
}

// The controller's own

TEST_F(UsbTest, ADamagedRecordIsRefusedWithWhatIsBehindIt) {
  configure();
  const std::vector<Bytes> damaged{
      {0x55, 0, 0},                          // kind
      {0x90, 0, 0},                          // of the other direction
      {0x13},                                // cut
      {0x11, 1, 20, 1, 2, 3},                // shorter than it says
      {0x11, 1, 65},                         // longer than a packet
      {0x11, 0x81, 0},                       // to the host
      {0x13, 0x01, 0},                       // from it
      {0x10, 0, 7, 1, 2, 3, 4, 5, 6, 7},     // a setup is 8 bytes
      {0x10, 1, 8, 1, 2, 3, 4, 5, 6, 7, 8},  // of endpoint 0
      {0x01, 1, 0},                          // a reset of an endpoint
  };
  for (const Bytes& bytes : damaged) {
    std::vector<Bytes> records{record(UsbRecord::in, 0x8F), bytes};
    if (bytes.size() >= 3 && bytes.size() >= 3u + bytes[2])
      records.push_back(record(UsbRecord::in, kVendorIn));
    const std::vector<Answer> answers = tick(records);
    ASSERT_EQ(answers.size(), 2u);
    EXPECT_EQ(answers[0].kind, UsbRecord::silence);
    EXPECT_EQ(answers[1].kind, UsbRecord::refused);
  }
  EXPECT_EQ(descriptor(1, 0, 18).value().size(), 18u);
}

// Records at random, and whole ones of every kind with random contents: whatever the host does, the board can
// be reset and works.
TEST_F(UsbTest, WhateverComesAResetHelps) {
  std::mt19937 random(1);
  const auto number = [&](unsigned most) { return static_cast<std::uint8_t>(random() % (most + 1)); };
  constexpr std::array kKinds{UsbRecord::reset,     UsbRecord::frame,  UsbRecord::suspend,
                              UsbRecord::resume,    UsbRecord::unplug, UsbRecord::setup,
                              UsbRecord::setup,     UsbRecord::setup,  UsbRecord::out_data0,
                              UsbRecord::out_data1, UsbRecord::in,     UsbRecord::in};
  for (int round = 0; round < 200; ++round) {
    configure();
    for (int i = 0; i < 20; ++i) {
      std::vector<Bytes> records;
      for (int k = 0; k < 5; ++k) {
        const UsbRecord kind = kKinds[number(kKinds.size() - 1)];
        Bytes data(kind == UsbRecord::setup ? 8 : kind == UsbRecord::in ? 0 : number(64));
        for (std::uint8_t& byte : data) byte = number(number(1) == 0 ? 9 : 255);
        const bool bus = kind < UsbRecord::setup;
        const auto address = static_cast<std::uint8_t>(number(3) | (kind == UsbRecord::in ? 0x80 : 0));
        records.push_back(record(kind, bus || kind == UsbRecord::setup ? 0 : address, bus ? Bytes{} : data));
        if (number(20) == 0) records.push_back(data);
      }
      if (number(3) == 0) say(frame(3u + number(200)));
      tick(records);
      received();
    }
    tick({record(UsbRecord::reset)});
    tick();
    heard();
  }
  configure();
  open_vendor();
  say(frame(65));
  EXPECT_EQ(read_transfer(kVendorIn), frame(65));
}

// A far end that does not take answers: the board waits with the next token, and loses none of those that the
// wires have room for.
TEST_F(UsbTest, NoAnswerIsLostWhereTheWiresAreFull) {
  configure();
  std::size_t asked = 0, answered = 0;
  const std::size_t lost = rig().bus.ticks_lost;
  while (rig().bus.from_board.free() >= lockstep::kUsbRecordBytes) {
    Bytes all;
    for (int i = 0; i < 20; ++i, ++asked) {
      const Bytes one = record(UsbRecord::in, 0x8F);
      all.insert(all.end(), one.begin(), one.end());
    }
    rig().wire.isr_receive(all);
    rig().wire.poll_receive();
  }
  for (int i = 0; i < 3; ++i) {
    answered += heard().size();
    rig().wire.poll_receive();
  }
  EXPECT_EQ(answered + heard().size(), asked);
  EXPECT_EQ(rig().bus.ticks_lost, lost);
  while (rig().bus.ticks_lost == lost) rig().wire.isr_receive(Bytes(2000, 0x13));
  rig().wire.poll_receive();
  EXPECT_EQ(heard().back().kind, UsbRecord::refused);
}

}  // namespace
}  // namespace palpate::board::test
