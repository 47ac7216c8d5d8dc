// A link to a board, or to a host, over a driver of the operating system: bytes, in real time. (What carries
// bytes in virtual time is medium.hpp.)
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "host/link/framing.hpp"

namespace palpate::link {

// The device is not there, is not what its address says, or may not be used. what() names address and reason.
class TransportError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct TransportCounters {
  std::uint64_t bytes_sent = 0;
  std::uint64_t bytes_received = 0;
  std::uint64_t frames_unsent = 0;  // dropped whole: the driver took no more, or the other end has gone
};

// An open link. One thread reads, one (the same or another) writes. A link whose other end has gone stays
// gone: is_open() turns false, and whoever wants it again opens it anew.
class Transport {
 public:
  virtual ~Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  // Hands over one frame of the framing (docs/protocol.md). Waits for the driver kWritePatience at most, at
  // the near end of a pseudo-terminal not at all; false: it is lost, whole or in part, and counted.
  virtual bool write(std::span<const std::uint8_t> frame) = 0;
  // Waits for bytes, at most that long, and returns those that are there; empty: none came.
  virtual std::vector<std::uint8_t> read(std::chrono::microseconds longest) = 0;
  [[nodiscard]] virtual bool is_open() const = 0;
  // As open_transport() takes it.
  [[nodiscard]] virtual std::string address() const = 0;
  // What it carries at most each way, for a sender that paces itself; 0: not known, more than 1 MB/s.
  [[nodiscard]] virtual double bytes_per_s() const = 0;
  [[nodiscard]] virtual TransportCounters counters() const = 0;
  // What the driver tells of errors of the medium, for a person; empty: nothing, or it tells none. Any
  // thread.
  [[nodiscard]] virtual std::string trouble() { return {}; }
  // How transfers become its bytes.
  [[nodiscard]] virtual FramingKind framing() const { return FramingKind::serial; }

  static constexpr std::chrono::milliseconds kWritePatience{20};  // some frames at 1 Mbaud

 protected:
  Transport() = default;
};

// Opens the link of an address:
//   serial:/dev/ttyACM0[,BAUD]   a serial line, 921600 where BAUD is not given, or a
//                                pseudo-terminal, without a rate then
//   udp:HOST:PORT                a peer that listens there
//   udp-listen:[HOST:]PORT       waits there for a peer: whoever was heard last is answered
//   can:INTERFACE                classic CAN (socketcan.hpp): frames of up to 8 bytes
//   canfd:INTERFACE              CAN FD; can:INTERFACE,fd is the same
//   usb:VID:PID[,SERIAL]         a USB device's own interface (usb_link.hpp), by its identifiers
//   pty:                         a new pseudo-terminal for another program; address() then has its path
// Throws TransportError.
std::unique_ptr<Transport> open_transport(std::string_view address);

}  // namespace palpate::link
