#include "shared/wire/can_frame.hpp"

namespace palpate::wire {
namespace {

// Identifier: 28..26 priority, 25 service, then
//   of a message: 24 anonymous, 23 reserved 0, 22..21 reserved 1 (receivers ignore them), 20..8 subject,
//   7 reserved 0, 6..0 source;
//   of a service: 24 request, 23 reserved 0, 22..14 service, 13..7 destination, 6..0 source.
constexpr unsigned kPriorityAt = 26;
constexpr std::uint32_t kService = 1u << 25;
constexpr std::uint32_t kRequest = 1u << 24;
constexpr std::uint32_t kAnonymous = 1u << 24;
constexpr std::uint32_t kReserved = 1u << 23;
constexpr std::uint32_t kMessageOnes = 3u << 21;
constexpr std::uint32_t kMessageReserved = 1u << 7;
constexpr unsigned kSubjectAt = 8;
constexpr unsigned kServiceAt = 14;
constexpr unsigned kDestinationAt = 7;

// Bits of a FrameHeader's specifier (ports.hpp).
constexpr std::uint16_t kServiceSpecifier = 0x8000u;
constexpr std::uint16_t kRequestSpecifier = 0x4000u;

constexpr std::uint8_t kStartBit = 0x80, kEndBit = 0x40, kToggleBit = 0x20;

}  // namespace

std::uint8_t can_tail_byte(const CanTail& tail) {
  return static_cast<std::uint8_t>((tail.start ? kStartBit : 0u) | (tail.end ? kEndBit : 0u) |
                                   (tail.toggle ? kToggleBit : 0u) | (tail.transfer_id & kCanTransferIdMask));
}

CanTail parse_can_tail(std::uint8_t byte) {
  return {.start = (byte & kStartBit) != 0,
          .end = (byte & kEndBit) != 0,
          .toggle = (byte & kToggleBit) != 0,
          .transfer_id = static_cast<std::uint8_t>(byte & kCanTransferIdMask)};
}

Status can_identifier(const FrameHeader& header, std::uint32_t& identifier) {
  if (header.source > kMaxCanNode) return Status::not_for_can;
  const std::uint32_t priority = std::uint32_t{static_cast<std::uint8_t>(header.priority)} << kPriorityAt;
  if ((header.specifier & kServiceSpecifier) == 0) {
    if (header.specifier > kMaxCanSubject || header.destination != kBroadcast) return Status::not_for_can;
    identifier = priority | kMessageOnes | (std::uint32_t{header.specifier} << kSubjectAt) | header.source;
    return Status::ok;
  }
  const bool request = (header.specifier & kRequestSpecifier) != 0;
  const std::uint32_t service =
      header.specifier & ~(std::uint32_t{kServiceSpecifier} | std::uint32_t{kRequestSpecifier});
  if (service > kMaxCanService || header.destination > kMaxCanNode) return Status::not_for_can;
  identifier = priority | kService | (request ? kRequest : 0u) | (service << kServiceAt) |
               (std::uint32_t{header.destination} << kDestinationAt) | header.source;
  return Status::ok;
}

Status parse_can_identifier(std::uint32_t identifier, FrameHeader& header) {
  if ((identifier & kReserved) != 0) return Status::header_version_unknown;
  const bool service = (identifier & kService) != 0;
  if (!service && (identifier & kMessageReserved) != 0) return Status::header_version_unknown;
  header.priority = static_cast<Priority>((identifier >> kPriorityAt) & 7u);
  header.source = static_cast<std::uint16_t>(identifier & kMaxCanNode);
  if (service) {
    const auto number = static_cast<std::uint16_t>((identifier >> kServiceAt) & kMaxCanService);
    header.specifier = (identifier & kRequest) != 0 ? request_specifier(number) : response_specifier(number);
    header.destination = static_cast<std::uint16_t>((identifier >> kDestinationAt) & kMaxCanNode);
    return Status::ok;
  }
  if ((identifier & kAnonymous) != 0) header.source = kBroadcast;
  header.specifier =
      message_specifier(static_cast<std::uint16_t>((identifier >> kSubjectAt) & kMaxCanSubject));
  header.destination = kBroadcast;
  return Status::ok;
}

}  // namespace palpate::wire
