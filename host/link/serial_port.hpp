// Serial lines, USB's among them (CDC-ACM), and pseudo-terminals.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "host/link/transport.hpp"

namespace palpate::link {

inline constexpr std::uint32_t kDefaultBaud = 921'600;

// 8 data bits, no parity, 1 stop bit, no flow control; what came before is dropped. `baud` must be a rate
// that the kernel has a name for, 1,200 to 4,000,000; none: kDefaultBaud. A pseudo-terminal takes any rate;
// without one its bytes_per_s() is 0, for it has none of its own. A line that another program has locked
// (flock(2), as pyserial's `exclusive`) is refused: a board obeys one host. Throws TransportError.
std::unique_ptr<Transport> open_serial_port(const std::string& path,
                                            std::optional<std::uint32_t> baud = std::nullopt);

// The near end of a new pseudo-terminal; its address is "serial:" and the path that another program opens.
// Stays open while no program has it open; what is written then, and does not fit in the kernel's buffer, is
// lost. Throws TransportError.
std::unique_ptr<Transport> open_pseudo_terminal();

}  // namespace palpate::link
