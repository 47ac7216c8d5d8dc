// A CAN interface as the kernel describes it: what was set with ip(8) and must be right before a link opens.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace palpate::link {

// What is not told (a virtual bus has no bit timing) is 0.
struct CanInterface {
  int index = 0;
  bool is_can = false;
  bool is_up = false;
  bool takes_fd = false;
  bool is_bus_off = false;
  std::uint32_t bit_rate = 0;       // 1/s, arbitration; all of a frame on classic CAN
  std::uint32_t data_bit_rate = 0;  // 1/s, of CAN FD
  std::uint32_t restart_ms = 0;     // from bus-off to a new try; 0: never
};

// Asks the kernel (rtnetlink). Throws TransportError: there is no such interface.
CanInterface read_can_interface(const std::string& name);

// From the kernel's answer, an RTM_NEWLINK message; nullopt: it is none, or is cut short.
std::optional<CanInterface> parse_can_interface(std::span<const std::uint8_t> message);

}  // namespace palpate::link
