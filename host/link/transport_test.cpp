#include "host/link/transport.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "host/link/link_testing.hpp"
#include "host/link/serial_port.hpp"

namespace palpate::link {
namespace {

using std::chrono::seconds;
using testing::Bytes;
using testing::counting;
using testing::kPatience;
using testing::message_of;
using testing::read_all;

Bytes every_byte() {
  return counting(256);
}

void expect_both_ways(Transport& a, Transport& b) {
  const Bytes bytes = every_byte();
  ASSERT_TRUE(a.write(bytes));
  EXPECT_EQ(read_all(b, bytes.size()), bytes);
  ASSERT_TRUE(b.write(bytes));
  EXPECT_EQ(read_all(a, bytes.size()), bytes);
  EXPECT_EQ(a.counters().bytes_sent, bytes.size());
  EXPECT_EQ(a.counters().bytes_received, bytes.size());
  EXPECT_EQ(a.counters().frames_unsent, 0u);
}

TEST(Transport, TerminalCarriesEveryByteBothWays) {
  const auto near = open_transport("pty:");
  const auto far = open_transport(near->address());
  expect_both_ways(*far, *near);
}

TEST(Transport, UdpCarriesEveryByteBothWays) {
  const auto server = open_transport("udp-listen:127.0.0.1:0");
  const std::string port = server->address().substr(server->address().rfind(':') + 1);
  const auto client = open_transport("udp:127.0.0.1:" + port);
  expect_both_ways(*client, *server);
}

TEST(Transport, UdpOutlivesAPeerThatIsNotThere) {
  std::string port;
  {
    const auto server = open_transport("udp-listen:127.0.0.1:0");
    port = server->address().substr(server->address().rfind(':') + 1);
  }
  const auto client = open_transport("udp:127.0.0.1:" + port);
  for (int i = 0; i < 10; ++i) client->write(every_byte());
  EXPECT_TRUE(client->read(seconds(0)).empty());
  EXPECT_TRUE(client->is_open());
  const auto server = open_transport("udp-listen:127.0.0.1:" + port);
  ASSERT_TRUE(client->write(every_byte()));
  EXPECT_EQ(read_all(*server, 256), every_byte());
}

TEST(Transport, UdpServerWithoutAPeerLosesAndGoesOn) {
  const auto server = open_transport("udp-listen:0");
  EXPECT_TRUE(server->write(every_byte()));
  EXPECT_TRUE(server->is_open());
}

TEST(Transport, ATerminalThatNobodyReadsLosesFramesAndCountsThem) {
  const auto near = open_transport("pty:");
  const Bytes frame(1024, 7);
  int lost = 0;
  for (int i = 0; i < 100; ++i) lost += near->write(frame) ? 0 : 1;  // the kernel holds some kilobytes
  EXPECT_GT(lost, 0);
  EXPECT_EQ(near->counters().frames_unsent, static_cast<std::uint64_t>(lost));
  EXPECT_TRUE(near->is_open());
}

TEST(Transport, AnEndThatHasGoneClosesTheOther) {
  auto near = open_transport("pty:");
  const auto far = open_transport(near->address());
  EXPECT_TRUE(far->is_open());
  near.reset();
  EXPECT_TRUE(read_all(*far, 1).empty());
  EXPECT_FALSE(far->is_open());
  EXPECT_FALSE(far->write(every_byte()));
  EXPECT_EQ(far->counters().frames_unsent, 1u);
}

TEST(Transport, OneHostALine) {
  const auto near = open_transport("pty:");
  auto first = open_transport(near->address());
  EXPECT_NE(message_of(near->address()).find("another program has it"), std::string::npos);
  first.reset();
  EXPECT_EQ(message_of(near->address()), "");
}

TEST(Transport, ReadGivesUpInTime) {
  const auto near = open_transport("pty:");
  EXPECT_TRUE(near->read(std::chrono::milliseconds(1)).empty());
  EXPECT_TRUE(near->is_open());
}

TEST(Transport, RefusesAddressesByName) {
  const auto has = [](std::string_view address, const char* text) {
    const std::string message = message_of(address);
    EXPECT_NE(message.find(text), std::string::npos) << address << ": " << message;
    EXPECT_NE(message.find(address), std::string::npos) << message;
  };
  has("", "allowed serial:PATH");
  has("serial:", "allowed serial:PATH");
  has("usb", "allowed serial:PATH");
  has("pty:x", "allowed serial:PATH");
  has("udp:host", "allowed serial:PATH");
  has("serial:/nowhere/tty", "No such file");
  has("serial:/dev/null", "no serial line");
  has("udp:127.0.0.1:0", "port is '0', allowed 1..65535");
  has("udp:127.0.0.1:x", "port is 'x'");
  has("udp-listen:70000", "allowed 0..65535");
  has("usb:", "allowed serial:PATH");
  has("usb:1209", "allowed usb:VID:PID[,SERIAL]");
  has("usb:1209:1", "PID is '1', allowed 4 hexadecimal digits");
  has("usb:12g9:0001", "VID is '12g9', allowed 4 hexadecimal digits");
  has("can:", "allowed serial:PATH");
  has("canfd:nowhere0", "No such device");
  has("can:lo", "lo is no CAN interface");
  EXPECT_NE(message_of("serial:/dev/null,fast").find("baud is 'fast'"), std::string::npos);
  EXPECT_NE(message_of("serial:/dev/null,31337").find("baud is 31337, allowed 1200, 2400"),
            std::string::npos);
}

TEST(Transport, KnowsWhatASerialLineCarries) {
  const auto near = open_transport("pty:");
  EXPECT_DOUBLE_EQ(open_transport(near->address())->bytes_per_s(), 0.0);  // no line: no rate
  EXPECT_DOUBLE_EQ(open_transport(near->address() + ",115200")->bytes_per_s(), 11520.0);
}

}  // namespace
}  // namespace palpate::link
