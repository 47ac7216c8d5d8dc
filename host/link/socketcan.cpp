#include "host/link/socketcan.hpp"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "host/link/can_cost.hpp"
#include "shared/wire/can_record.hpp"

namespace palpate::link {
namespace {

// Few frames of ours wait in the kernel (its least is used), so that a sender soon sees that the bus is
// full; many that came may, so that a reader may be late.
constexpr int kSendBuffer_bytes = 1;
constexpr int kReceiveBuffer_bytes = 1 << 20;

std::string address_of(const std::string& interface, wire::CanFormat format) {
  return (format == wire::CanFormat::fd ? "canfd:" : "can:") + interface;
}

CanInterface checked(const std::string& name, wire::CanFormat format) {
  const std::string address = address_of(name, format);
  CanInterface found;
  try {
    found = read_can_interface(name);
  } catch (const TransportError& error) {
    throw TransportError(address + ": " + error.what());
  }
  const std::string command =
      "; as root: ip link set " + name + " up type can bitrate 1000000 restart-ms 100";
  if (!found.is_can) throw TransportError(address + ": " + name + " is no CAN interface");
  if (!found.is_up) throw TransportError(address + ": the interface is down" + command);
  if (format == wire::CanFormat::fd && !found.takes_fd)
    throw TransportError(address + ": the interface carries classic CAN only" + command +
                         " dbitrate 5000000 fd on (a virtual one: mtu 72)");
  return found;
}

// Bytes of records a second, of frames that are full; 0: the bit rate is not known (a virtual bus).
double record_bytes_per_s(const CanInterface& interface, bool fd) {
  if (interface.bit_rate == 0 || (fd && interface.data_bit_rate == 0)) return 0.0;
  const CanBus bus{.fd = fd,
                   .nominal_bit_s = 1.0 / interface.bit_rate,
                   .data_bit_s = 1.0 / (fd ? interface.data_bit_rate : interface.bit_rate)};
  const std::size_t data_bytes = wire::can_mtu(fd ? wire::CanFormat::fd : wire::CanFormat::classic);
  return static_cast<double>(data_bytes + wire::kCanRecordOverheadBytes) / can_frame_s(bus, data_bytes);
}

class RawSocket {
 public:
  explicit RawSocket(std::string address)
      : address_(std::move(address)),
        descriptor_(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)) {
    check(descriptor_.get());
  }
  template <class Value>
  RawSocket& set(int level, int option, const Value& value) {
    check(::setsockopt(descriptor_.get(), level, option, &value, sizeof value));
    return *this;
  }
  RawSocket& set_no_filter() {
    check(::setsockopt(descriptor_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0));
    return *this;
  }
  Descriptor bound_to(int index) && {
    sockaddr_can where{};
    where.can_family = AF_CAN;
    where.can_ifindex = index;
    check(::bind(descriptor_.get(), reinterpret_cast<const sockaddr*>(&where), sizeof where));
    return std::move(descriptor_);
  }

 private:
  void check(int result) const {
    if (result < 0) throw TransportError(address_ + ": " + std::strerror(errno));
  }
  std::string address_;
  Descriptor descriptor_;
};

Descriptor frame_socket(const std::string& address, int index, bool fd) {
  const can_filter extended_data{.can_id = CAN_EFF_FLAG, .can_mask = CAN_EFF_FLAG | CAN_RTR_FLAG};
  RawSocket socket(address);
  socket.set(SOL_SOCKET, SO_SNDBUF, kSendBuffer_bytes)
      .set(SOL_SOCKET, SO_RCVBUF, kReceiveBuffer_bytes)
      .set(SOL_SOCKET, SO_RXQ_OVFL, 1)
      .set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, int{fd})
      .set(SOL_CAN_RAW, CAN_RAW_FILTER, extended_data);
  return std::move(socket).bound_to(index);
}

// Errors have a socket of their own: a writer must see that the bus is off, whoever reads frames.
Descriptor error_socket(const std::string& address, int index) {
  RawSocket socket(address);
  socket.set_no_filter().set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK});
  return std::move(socket).bound_to(index);
}

bool is_gone(int error) {
  return error == ENETDOWN || error == ENODEV || error == ENXIO;
}

// One received frame, classic or FD, and how many the kernel has dropped so far, where it says so.
struct Received {
  ssize_t size = 0;
  canfd_frame frame{};
  bool has_missed = false;
  std::uint32_t missed = 0;
};

Received receive(int descriptor) {
  Received received;
  iovec part{.iov_base = &received.frame, .iov_len = sizeof received.frame};
  alignas(cmsghdr) std::array<std::uint8_t, CMSG_SPACE(sizeof(std::uint32_t))> control;
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  received.size = ::recvmsg(descriptor, &message, 0);
  if (received.size < 0) return received;
  const cmsghdr* head = CMSG_FIRSTHDR(&message);
  if (head != nullptr && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SO_RXQ_OVFL) {
    received.has_missed = true;
    std::memcpy(&received.missed, CMSG_DATA(head), sizeof received.missed);
  }
  return received;
}

}  // namespace

SocketCan::SocketCan(const std::string& interface, wire::CanFormat format)
    : SocketCan(interface, format, checked(interface, format)) {}

SocketCan::SocketCan(const std::string& name, wire::CanFormat format, const CanInterface& interface)
    : DescriptorLink(frame_socket(address_of(name, format), interface.index, format == wire::CanFormat::fd),
                     address_of(name, format), record_bytes_per_s(interface, format == wire::CanFormat::fd)),
      fd_(format == wire::CanFormat::fd),
      error_socket_(error_socket(address_of(name, format), interface.index)),
      is_bus_off_(interface.is_bus_off) {}

void SocketCan::take_errors() {
  const std::scoped_lock lock(mutex_);
  can_frame frame{};
  ssize_t count = 0;
  while ((count = ::recv(error_socket_.get(), &frame, sizeof frame, 0)) == CAN_MTU)
    count_error(frame, errors_, is_bus_off_);
  if (count < 0 && is_gone(errno)) gone_ = true;
}

CanErrors SocketCan::errors() {
  take_errors();
  const std::scoped_lock lock(mutex_);
  errors_.frames_missed = frames_missed_;
  return errors_;
}

bool SocketCan::is_bus_off() {
  take_errors();
  const std::scoped_lock lock(mutex_);
  return is_bus_off_;
}

std::string SocketCan::trouble() {
  return text_of(errors(), is_bus_off());
}

std::vector<std::uint8_t> SocketCan::read(std::chrono::microseconds longest) {
  take_errors();  // so that they do not pile up where nobody writes
  if (gone_) return {};
  return DescriptorLink::read(longest);
}

ssize_t SocketCan::put(std::span<const std::uint8_t> bytes) {
  wire::CanRecordReader reader;
  const wire::CanRecordReader::Step step = reader.read(bytes);
  if (step.found != wire::CanRecordReader::Found::frame)
    throw std::invalid_argument(address() + ": " + std::to_string(bytes.size()) +
                                " bytes do not begin with a whole record of a CAN frame");
  if (step.frame.fd && !fd_)
    throw std::invalid_argument(address() + ": a frame in FD format, on a link of classic CAN");
  if (is_bus_off() || gone_) {
    errno = gone_ ? ENETDOWN : ENOBUFS;
    return -1;
  }
  // A classic frame is the beginning of this struct.
  canfd_frame frame{};
  frame.can_id = step.frame.identifier | CAN_EFF_FLAG;
  frame.len = static_cast<std::uint8_t>(step.frame.data.size());
  frame.flags = step.frame.fd ? CANFD_BRS : 0;
  std::copy(step.frame.data.begin(), step.frame.data.end(), std::begin(frame.data));
  const std::size_t size = step.frame.fd ? CANFD_MTU : CAN_MTU;
  const ssize_t count = ::send(descriptor(), &frame, size, 0);
  return count < 0 ? count : static_cast<ssize_t>(step.consumed);
}

ssize_t SocketCan::get(std::span<std::uint8_t> bytes) {
  std::size_t filled = 0;
  while (bytes.size() - filled >= wire::kMaxCanRecordBytes) {
    const Received received = receive(descriptor());
    if (received.size < 0) {
      if (filled == 0) return -1;
      if (is_gone(errno)) gone_ = true;  // told once
      break;
    }
    if (received.has_missed) frames_missed_ = received.missed;
    // A virtual bus carries FD frames of any length; a controller would have filled them up.
    const std::size_t data_bytes = wire::can_padded_bytes(received.frame.len);
    filled += wire::write_can_record({.identifier = received.frame.can_id & CAN_EFF_MASK,
                                      .fd = received.size == static_cast<ssize_t>(CANFD_MTU),
                                      .data = std::span(received.frame.data).first(data_bytes)},
                                     bytes.subspan(filled));
  }
  return static_cast<ssize_t>(filled);
}

}  // namespace palpate::link
