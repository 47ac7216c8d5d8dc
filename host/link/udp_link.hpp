// A link over UDP, between two computers as in the paper's section 5: one frame a datagram, so that a lost
// datagram costs a frame and no more.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "host/link/transport.hpp"

namespace palpate::link {

// Sends to a peer and takes what comes from it alone. Throws TransportError.
std::unique_ptr<Transport> open_udp(const std::string& host, std::uint16_t port);

// Takes from anybody who sends to `port` on the interface of `host` ("127.0.0.1": from this computer only)
// and answers whoever was heard last. Port 0: the system chooses one; address() has it. Throws
// TransportError.
std::unique_ptr<Transport> listen_udp(const std::string& host, std::uint16_t port);

}  // namespace palpate::link
