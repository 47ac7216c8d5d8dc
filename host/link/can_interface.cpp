#include "host/link/can_interface.hpp"

#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "host/link/descriptor_link.hpp"

namespace palpate::link {
namespace {

using Bytes = std::span<const std::uint8_t>;

// Larger than any description of a CAN interface (the kernel sends about 2 kB).
constexpr std::size_t kAnswer_bytes = 32768;

// A copy of the struct that begins these bytes; zeros if they are too few.
template <class Struct>
Struct as(Bytes bytes) {
  Struct value{};
  if (bytes.size() >= sizeof value) std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

// Payload of the first attribute of this type; empty: there is none.
Bytes find(Bytes attributes, unsigned type) {
  while (attributes.size() >= sizeof(rtattr)) {
    const auto head = as<rtattr>(attributes);
    if (head.rta_len < sizeof(rtattr) || head.rta_len > attributes.size()) break;
    if ((head.rta_type & NLA_TYPE_MASK) == type)
      return attributes.subspan(sizeof(rtattr), head.rta_len - sizeof(rtattr));
    attributes = attributes.subspan(std::min<std::size_t>(RTA_ALIGN(head.rta_len), attributes.size()));
  }
  return {};
}

struct Request {
  nlmsghdr head;
  ifinfomsg interface;
  rtattr name_head;
  std::array<char, IFNAMSIZ> name;
};
static_assert(sizeof(Request) == NLMSG_ALIGN(sizeof(nlmsghdr)) + sizeof(ifinfomsg) + RTA_SPACE(IFNAMSIZ));

[[noreturn]] void fail(const std::string& name, int error) {
  throw TransportError("CAN interface '" + name + "': " + std::strerror(error));
}

}  // namespace

std::optional<CanInterface> parse_can_interface(std::span<const std::uint8_t> message) {
  const auto head = as<nlmsghdr>(message);
  if (head.nlmsg_type != RTM_NEWLINK || head.nlmsg_len > message.size() ||
      head.nlmsg_len < NLMSG_LENGTH(sizeof(ifinfomsg)))
    return std::nullopt;
  const Bytes body = message.subspan(NLMSG_HDRLEN, head.nlmsg_len - NLMSG_HDRLEN);
  const auto link = as<ifinfomsg>(body);
  const Bytes attributes = body.subspan(NLMSG_ALIGN(sizeof(ifinfomsg)));
  const Bytes controller = find(find(attributes, IFLA_LINKINFO), IFLA_INFO_DATA);
  return CanInterface{
      .index = link.ifi_index,
      .is_can = link.ifi_type == ARPHRD_CAN,
      .is_up = (link.ifi_flags & IFF_UP) != 0,
      .takes_fd = as<std::uint32_t>(find(attributes, IFLA_MTU)) >= CANFD_MTU,
      .is_bus_off = as<std::uint32_t>(find(controller, IFLA_CAN_STATE)) == CAN_STATE_BUS_OFF,
      .bit_rate = as<can_bittiming>(find(controller, IFLA_CAN_BITTIMING)).bitrate,
      .data_bit_rate = as<can_bittiming>(find(controller, IFLA_CAN_DATA_BITTIMING)).bitrate,
      .restart_ms = as<std::uint32_t>(find(controller, IFLA_CAN_RESTART_MS)),
  };
}

CanInterface read_can_interface(const std::string& name) {
  if (name.empty() || name.size() >= IFNAMSIZ) fail(name, ENODEV);
  const Descriptor netlink(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  if (netlink.get() < 0) fail(name, errno);
  Request request{};
  request.head.nlmsg_len = sizeof request;
  request.head.nlmsg_type = RTM_GETLINK;
  request.head.nlmsg_flags = NLM_F_REQUEST;
  request.name_head = {.rta_len = RTA_LENGTH(IFNAMSIZ), .rta_type = IFLA_IFNAME};
  std::memcpy(request.name.data(), name.c_str(), name.size());
  if (::send(netlink.get(), &request, sizeof request, 0) < 0) fail(name, errno);
  // The kernel answers before send() returns.
  std::array<std::uint8_t, kAnswer_bytes> answer{};
  const ssize_t count = ::recv(netlink.get(), answer.data(), answer.size(), MSG_DONTWAIT);
  if (count < 0) fail(name, errno);
  const Bytes message = Bytes(answer).first(static_cast<std::size_t>(count));
  if (as<nlmsghdr>(message).nlmsg_type == NLMSG_ERROR)
    fail(name, -as<nlmsgerr>(message.subspan(NLMSG_HDRLEN)).error);
  const std::optional<CanInterface> found = parse_can_interface(message);
  if (!found) fail(name, EBADMSG);
  return *found;
}

}  // namespace palpate::link
