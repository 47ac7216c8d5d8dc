#include "shared/wire/node.hpp"

#include <algorithm>

namespace palpate::wire {

template <>
Status serialize(const Heartbeat& message, std::span<std::uint8_t> out, std::size_t& written) {
  if (out.size() < MessageTraits<Heartbeat>::kMaxBytes) return Status::payload_malformed;
  for (unsigned i = 0; i < 4; ++i) out[i] = static_cast<std::uint8_t>(message.uptime_s >> (8 * i));
  out[4] = static_cast<std::uint8_t>(message.health);
  out[5] = static_cast<std::uint8_t>(message.mode);
  out[6] = message.vendor_status;
  written = MessageTraits<Heartbeat>::kMaxBytes;
  return Status::ok;
}

template <>
Status serialize(const TimeSynchronization& message, std::span<std::uint8_t> out, std::size_t& written) {
  constexpr std::size_t kBytes = MessageTraits<TimeSynchronization>::kMaxBytes;
  if (out.size() < kBytes) return Status::payload_malformed;
  for (unsigned i = 0; i < kBytes; ++i) out[i] = static_cast<std::uint8_t>(message.previous_us >> (8 * i));
  written = kBytes;
  return Status::ok;
}

template <>
Status serialize(const NodeInfo& message, std::span<std::uint8_t> out, std::size_t& written) {
  if (out.size() < MessageTraits<NodeInfo>::kMaxBytes || !is_node_name(message.board))
    return Status::payload_malformed;
  constexpr NodeVersion kProtocol{.major = 1, .minor = 0};
  std::uint8_t* at = out.data();
  for (const NodeVersion& version : {kProtocol, message.hardware, message.software}) {
    *at++ = version.major;
    *at++ = version.minor;
  }
  at = std::fill_n(at, 8, std::uint8_t{0});  // revision number
  at = std::copy(message.unique_id.begin(), message.unique_id.end(), at);
  *at++ = static_cast<std::uint8_t>(kNodeNamePrefix.size() + message.board.size());
  at = std::copy(kNodeNamePrefix.begin(), kNodeNamePrefix.end(), at);
  at = std::copy(message.board.begin(), message.board.end(), at);
  *at++ = 0;  // checksums of the image
  *at++ = 0;  // bytes of a certificate
  written = static_cast<std::size_t>(at - out.data());
  return Status::ok;
}

}  // namespace palpate::wire
