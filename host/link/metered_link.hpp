// A link metered in virtual time, both directions of it, by the name of its medium.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "host/link/bus_errors.hpp"
#include "host/link/framing.hpp"
#include "host/link/medium.hpp"
#include "host/link/usb_host.hpp"

namespace palpate::link {

enum class MediumKind : std::uint8_t {
  uart,   // a line for each direction (uart.hpp)
  can,    // a classic CAN bus (can_bus.hpp)
  canfd,  // a CAN FD bus
  usb,    // a full-speed bus with the board's own USB stack at its end (usb_host.hpp)
};

struct MeteredLinkOptions {
  MediumKind medium = MediumKind::uart;
  std::uint32_t baud = 12'000'000;             // of a UART
  std::uint32_t bit_rate_Hz = 1'000'000;       // of CAN: arbitration, on classic CAN all of a frame
  std::uint32_t data_bit_rate_Hz = 5'000'000;  // of CAN FD
  std::size_t queue_bytes = 1u << 20;          // that may wait in each direction
  BusErrors errors{};                          // of CAN and USB
};

// CAN in 10 kbit/s to 1 Mbit/s, data of CAN FD to 8 Mbit/s and never slower than the arbitration.
inline constexpr std::uint32_t kMinBitRate_Hz = 10'000;
inline constexpr std::uint32_t kMaxBitRate_Hz = 1'000'000;
inline constexpr std::uint32_t kMaxDataBitRate_Hz = 8'000'000;

class MeteredLink {
 public:
  virtual ~MeteredLink() = default;
  MeteredLink(const MeteredLink&) = delete;
  MeteredLink& operator=(const MeteredLink&) = delete;

  virtual Medium& down() = 0;  // host to board
  virtual Medium& up() = 0;    // board to host
  // Of USB: what is at the host's end. At the board's records of the bus cross.
  virtual UsbHost* usb_host() { return nullptr; }

 protected:
  MeteredLink() = default;
};

// Throws std::invalid_argument for rates out of range, or without room in the queue.
std::unique_ptr<MeteredLink> make_metered_link(const MeteredLinkOptions& options);

// What both ends speak on it.
FramingKind framing_of(MediumKind medium);

}  // namespace palpate::link
