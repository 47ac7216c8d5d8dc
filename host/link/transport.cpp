#include "host/link/transport.hpp"

#include <charconv>
#include <cstdint>

#include "host/link/serial_port.hpp"
#include "host/link/socketcan.hpp"
#include "host/link/udp_link.hpp"
#include "host/link/usb_link.hpp"

namespace palpate::link {
namespace {

std::uint32_t number(std::string_view address, const char* what, std::string_view text, std::uint32_t least,
                     std::uint32_t most) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < least || value > most)
    throw TransportError(std::string(address) + ": " + what + " is '" + std::string(text) + "', allowed " +
                         std::to_string(least) + ".." + std::to_string(most));
  return value;
}

std::uint16_t port_of(std::string_view address, std::string_view text, std::uint32_t least) {
  return static_cast<std::uint16_t>(number(address, "port", text, least, UINT16_MAX));
}

std::unique_ptr<Transport> open_serial_address(std::string_view address, std::string_view rest) {
  const std::size_t comma = rest.rfind(',');
  if (comma == std::string_view::npos) return open_serial_port(std::string(rest));
  return open_serial_port(std::string(rest.substr(0, comma)),
                          number(address, "baud", rest.substr(comma + 1), 1, UINT32_MAX));
}

std::unique_ptr<Transport> open_can_address(std::string_view kind, std::string_view rest) {
  constexpr std::string_view kFd = ",fd";
  const bool marked = rest.ends_with(kFd);
  if (marked) rest.remove_suffix(kFd.size());
  const bool fd = marked || kind == "canfd";
  return std::make_unique<SocketCan>(std::string(rest), fd ? wire::CanFormat::fd : wire::CanFormat::classic);
}

}  // namespace

std::unique_ptr<Transport> open_transport(std::string_view address) {
  const std::size_t colon = address.find(':');
  const std::string_view kind = address.substr(0, colon);
  const std::string_view rest = colon == std::string_view::npos ? "" : address.substr(colon + 1);
  const std::size_t last = rest.rfind(':');
  if (kind == "serial" && !rest.empty()) return open_serial_address(address, rest);
  if (kind == "pty" && colon != std::string_view::npos && rest.empty()) return open_pseudo_terminal();
  if (kind == "udp" && last != std::string_view::npos && last > 0)
    return open_udp(std::string(rest.substr(0, last)), port_of(address, rest.substr(last + 1), 1));
  if (kind == "udp-listen") {
    const bool named = last != std::string_view::npos;
    return listen_udp(named ? std::string(rest.substr(0, last)) : "0.0.0.0",
                      port_of(address, named ? rest.substr(last + 1) : rest, 0));
  }
  if ((kind == "can" || kind == "canfd") && !rest.empty()) return open_can_address(kind, rest);
  if (kind == "usb" && !rest.empty()) return open_usb(parse_usb_address(rest));
  throw TransportError("link '" + std::string(address) +
                       "': allowed serial:PATH[,BAUD], udp:HOST:PORT, udp-listen:[HOST:]PORT, "
                       "can:INTERFACE[,fd], canfd:INTERFACE, usb:VID:PID[,SERIAL], pty:");
}

}  // namespace palpate::link
