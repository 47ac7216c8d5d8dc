#include "host/link/udp_link.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <utility>

#include "host/link/descriptor_link.hpp"

namespace palpate::link {
namespace {

struct Peer {
  sockaddr_storage where{};
  socklen_t length = 0;
};

Peer resolve(const std::string& address, const std::string& host, std::uint16_t port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
    throw TransportError(address + ": " + ::gai_strerror(error));
  Peer peer;
  std::memcpy(&peer.where, found->ai_addr, found->ai_addrlen);
  peer.length = found->ai_addrlen;
  ::freeaddrinfo(found);
  return peer;
}

Descriptor open_socket(const std::string& address, const Peer& peer) {
  Descriptor descriptor(::socket(peer.where.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (descriptor.get() < 0) throw TransportError(address + ": " + std::strerror(errno));
  return descriptor;
}

const sockaddr* as_address(const Peer& peer) {
  return reinterpret_cast<const sockaddr*>(&peer.where);
}

// A refused datagram (nobody listens yet) is no end: UDP has none.
class UdpLink : public DescriptorLink {
 public:
  using DescriptorLink::DescriptorLink;

 protected:
  [[nodiscard]] bool is_end(int) const override { return false; }
  ssize_t put(std::span<const std::uint8_t> bytes) override {
    const ssize_t count = ::send(descriptor(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    // Lost, as on the way: whoever waits here waits for nothing.
    return count < 0 && errno == ECONNREFUSED ? static_cast<ssize_t>(bytes.size()) : count;
  }
  ssize_t get(std::span<std::uint8_t> bytes) override {
    return keep_open(::recv(descriptor(), bytes.data(), bytes.size(), 0));
  }
  // An empty datagram is none, and no end either.
  static ssize_t keep_open(ssize_t count) {
    if (count == 0) errno = EAGAIN;
    return count == 0 ? -1 : count;
  }
};

class UdpServer final : public UdpLink {
 public:
  using UdpLink::UdpLink;

 protected:
  ssize_t put(std::span<const std::uint8_t> bytes) override {
    const Peer peer = heard();
    if (peer.length == 0) return static_cast<ssize_t>(bytes.size());  // nobody listens
    const ssize_t count =
        ::sendto(descriptor(), bytes.data(), bytes.size(), MSG_NOSIGNAL, as_address(peer), peer.length);
    return count < 0 && errno == ECONNREFUSED ? static_cast<ssize_t>(bytes.size()) : count;
  }
  ssize_t get(std::span<std::uint8_t> bytes) override {
    Peer peer;
    peer.length = sizeof peer.where;
    const ssize_t count = ::recvfrom(descriptor(), bytes.data(), bytes.size(), 0,
                                     reinterpret_cast<sockaddr*>(&peer.where), &peer.length);
    if (count > 0) {
      const std::scoped_lock lock(mutex_);
      heard_ = peer;
    }
    return keep_open(count);
  }

 private:
  Peer heard() {
    const std::scoped_lock lock(mutex_);
    return heard_;
  }
  std::mutex mutex_;  // of heard_, between the reader and the writer
  Peer heard_;
};

std::uint16_t bound_port(int descriptor) {
  Peer self;
  self.length = sizeof self.where;
  if (::getsockname(descriptor, reinterpret_cast<sockaddr*>(&self.where), &self.length) != 0) return 0;
  return ntohs(self.where.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6*>(&self.where)->sin6_port
                   : reinterpret_cast<const sockaddr_in*>(&self.where)->sin_port);
}

}  // namespace

std::unique_ptr<Transport> open_udp(const std::string& host, std::uint16_t port) {
  const std::string address = "udp:" + host + ":" + std::to_string(port);
  const Peer peer = resolve(address, host, port);
  Descriptor descriptor = open_socket(address, peer);
  if (::connect(descriptor.get(), as_address(peer), peer.length) != 0)
    throw TransportError(address + ": " + std::strerror(errno));
  return std::make_unique<UdpLink>(std::move(descriptor), address, 0.0);
}

std::unique_ptr<Transport> listen_udp(const std::string& host, std::uint16_t port) {
  const std::string address = "udp-listen:" + host + ":" + std::to_string(port);
  const Peer self = resolve(address, host, port);
  Descriptor descriptor = open_socket(address, self);
  if (::bind(descriptor.get(), as_address(self), self.length) != 0)
    throw TransportError(address + ": " + std::strerror(errno));
  const std::string bound = "udp-listen:" + host + ":" + std::to_string(bound_port(descriptor.get()));
  return std::make_unique<UdpServer>(std::move(descriptor), bound, 0.0);
}

}  // namespace palpate::link
