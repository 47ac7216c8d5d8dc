#include "host/link/can_interface.hpp"

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>

#include <cstring>
#include <vector>

#include "host/link/transport.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Struct>
Bytes bytes_of(const Struct& value) {
  Bytes bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

void append(Bytes& to, const Bytes& bytes) {
  for (const std::uint8_t byte : bytes) to.push_back(byte);
}

Bytes attribute(unsigned short type, const Bytes& payload) {
  Bytes bytes = bytes_of(
      rtattr{.rta_len = static_cast<unsigned short>(sizeof(rtattr) + payload.size()), .rta_type = type});
  append(bytes, payload);
  bytes.resize(RTA_ALIGN(bytes.size()));
  return bytes;
}

Bytes message(unsigned short type, unsigned flags, const Bytes& attributes) {
  const ifinfomsg link{
      .ifi_family = 0, .__ifi_pad = 0, .ifi_type = type, .ifi_index = 7, .ifi_flags = flags, .ifi_change = 0};
  nlmsghdr head{};
  head.nlmsg_type = RTM_NEWLINK;
  head.nlmsg_len = static_cast<std::uint32_t>(NLMSG_HDRLEN + sizeof link + attributes.size());
  Bytes bytes = bytes_of(head);
  append(bytes, bytes_of(link));
  append(bytes, attributes);
  return bytes;
}

Bytes timing(std::uint32_t bit_rate) {
  can_bittiming value{};
  value.bitrate = bit_rate;
  return bytes_of(value);
}

Bytes controller_attributes(can_state state) {
  Bytes data = attribute(IFLA_CAN_BITTIMING, timing(1'000'000));
  append(data, attribute(IFLA_CAN_STATE, bytes_of(state)));
  append(data, attribute(IFLA_CAN_RESTART_MS, bytes_of(std::uint32_t{100})));
  append(data, attribute(IFLA_CAN_DATA_BITTIMING, timing(5'000'000)));
  Bytes info = attribute(IFLA_INFO_KIND, {'c', 'a', 'n'});
  append(info, attribute(IFLA_INFO_DATA, data));
  Bytes all = attribute(IFLA_IFNAME, {'c', 'a', 'n', '0', 0});
  append(all, attribute(IFLA_MTU, bytes_of(std::uint32_t{CANFD_MTU})));
  append(all, attribute(IFLA_LINKINFO | NLA_F_NESTED, info));
  return all;
}

TEST(CanInterface, OfAController) {
  const auto found =
      parse_can_interface(message(ARPHRD_CAN, IFF_UP, controller_attributes(CAN_STATE_ERROR_ACTIVE)));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->index, 7);
  EXPECT_TRUE(found->is_can);
  EXPECT_TRUE(found->is_up);
  EXPECT_TRUE(found->takes_fd);
  EXPECT_FALSE(found->is_bus_off);
  EXPECT_EQ(found->bit_rate, 1'000'000u);
  EXPECT_EQ(found->data_bit_rate, 5'000'000u);
  EXPECT_EQ(found->restart_ms, 100u);
}

TEST(CanInterface, OffTheBus) {
  const auto found = parse_can_interface(message(ARPHRD_CAN, 0, controller_attributes(CAN_STATE_BUS_OFF)));
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->is_bus_off);
  EXPECT_FALSE(found->is_up);
}

TEST(CanInterface, OfAVirtualBusWithoutTiming) {
  const auto found =
      parse_can_interface(message(ARPHRD_CAN, IFF_UP, attribute(IFLA_MTU, bytes_of(std::uint32_t{CAN_MTU}))));
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->takes_fd);
  EXPECT_EQ(found->bit_rate, 0u);
  EXPECT_EQ(found->restart_ms, 0u);
}

// No length that an attribute claims makes it read beyond what is there.
TEST(CanInterface, CutAnywhereItIsRefusedOrLacksTheRest) {
  const Bytes whole = message(ARPHRD_CAN, IFF_UP, controller_attributes(CAN_STATE_ERROR_ACTIVE));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_FALSE(parse_can_interface(cut)) << length;
    if (length < NLMSG_LENGTH(sizeof(ifinfomsg))) continue;
    auto head = nlmsghdr{};
    std::memcpy(&head, cut.data(), sizeof head);
    head.nlmsg_len = static_cast<std::uint32_t>(length);
    std::memcpy(cut.data(), &head, sizeof head);
    const auto found = parse_can_interface(cut);
    ASSERT_TRUE(found) << length;
    EXPECT_EQ(found->index, 7);
    EXPECT_EQ(found->data_bit_rate, 0u) << length;  // the last of all
  }
}

// Every Linux has this one.
TEST(CanInterface, TheKernelKnowsItsInterfaces) {
  const CanInterface loopback = read_can_interface("lo");
  EXPECT_FALSE(loopback.is_can);
  EXPECT_GT(loopback.index, 0);
}

TEST(CanInterface, NamesWhatIsNotThere) {
  using Name = std::string;
  for (const Name& name : {Name(), Name("nowhere0"), Name("a_name_longer_than_any_interface_has")}) {
    try {
      read_can_interface(name);
      ADD_FAILURE() << name;
    } catch (const TransportError& error) {
      EXPECT_NE(std::string(error.what()).find("'" + name + "'"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("No such device"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace palpate::link
