// What a Cyphal node says of itself: uavcan.node.Heartbeat.1.0, uavcan.node.GetInfo.1.0 in response, and the
// time, uavcan.time.Synchronization.1.0.
//
// The standard's types, not ours (and not in the schema hash): their layout is fixed, so they are written
// here without generated code. hil_tests/test_cyphal_node.py holds them against the public definitions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "shared/status.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/ports.hpp"

namespace palpate::wire {

// uavcan.node.Health.1.0
enum class NodeHealth : std::uint8_t {
  nominal = 0,
  advisory = 1,
  caution = 2,  // degraded, or outside of what it is designed for
  warning = 3,  // unable to do what it is for
};

// uavcan.node.Mode.1.0
enum class NodeMode : std::uint8_t {
  operational = 0,
  initialization = 1,
  maintenance = 2,  // calibration, self-test
  software_update = 3,
};

// Once a second; who sends none for three is gone.
struct Heartbeat {
  std::uint32_t uptime_s = 0;
  NodeHealth health = NodeHealth::nominal;
  NodeMode mode = NodeMode::operational;
  std::uint8_t vendor_status = 0;
};
inline constexpr std::uint32_t kHeartbeatPeriod_s = 1;

// A master says in each of these when the one before went out; 0: there is none, or it is more than a second
// old. At most a second apart, so that slaves follow: half of it leaves them room.
struct TimeSynchronization {
  std::uint64_t previous_us = 0;  // 56 bits
};
inline constexpr std::uint32_t kTimePeriod_ms = 500;
inline constexpr std::uint32_t kMaxTimePeriod_ms = 1000;
// A node that has sent no heartbeat for so long is gone.
inline constexpr std::uint32_t kNodeTimeout_s = 3;

struct NodeVersion {
  std::uint8_t major = 0;
  std::uint8_t minor = 0;
  bool operator==(const NodeVersion&) const = default;
};

// Of "1.20.3", 1 and 20; zero for what is no number from 0 to 255. Any context.
constexpr NodeVersion node_version(std::string_view text) {
  constexpr unsigned kNone = 256;
  NodeVersion version;
  std::size_t at = 0;
  for (std::uint8_t* const part : {&version.major, &version.minor}) {
    unsigned number = 0;
    for (; at < text.size() && text[at] != '.'; ++at) {
      const bool digit = text[at] >= '0' && text[at] <= '9';
      number = digit && number < kNone ? 10 * number + static_cast<unsigned>(text[at] - '0') : kNone;
    }
    *part = static_cast<std::uint8_t>(number < kNone ? number : 0);
    ++at;  // behind the point
  }
  return version;
}

// 128 bits that no other node has; not all zero.
using UniqueId = std::array<std::uint8_t, 16>;

// Response to uavcan.node.GetInfo.1.0. Of what it may hold, ours has no revision number (zero), no checksum
// of the image and no certificate.
inline constexpr std::string_view kNodeNamePrefix = "org.palpate.";
inline constexpr std::size_t kMaxNodeName = 50;
struct NodeInfo {
  NodeVersion hardware;  // zero: not told
  NodeVersion software;
  UniqueId unique_id{};
  std::string_view board;  // the node's name is kNodeNamePrefix and this
};

// May a board be called that? The standard's characters, and not too long. Any context.
constexpr bool is_node_name(std::string_view board) {
  for (const char one : board)
    if (!(one >= 'a' && one <= 'z') && !(one >= '0' && one <= '9') && one != '.' && one != '-' && one != '_')
      return false;
  return !board.empty() && board.size() <= kMaxNodeName - kNodeNamePrefix.size();
}

template <>
struct MessageTraits<Heartbeat> : BasicMessageTraits<message_specifier(kHeartbeatSubject), 7> {};
template <>
struct MessageTraits<TimeSynchronization> : BasicMessageTraits<message_specifier(kTimeSubject), 7> {};
template <>
struct MessageTraits<NodeInfo>
    : BasicMessageTraits<response_specifier(kNodeInfoService), 30 + 1 + kMaxNodeName + 1 + 1> {};

// As in messages.hpp. Status::payload_malformed also for a name that is none.
template <>
Status serialize(const Heartbeat& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status serialize(const TimeSynchronization& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status serialize(const NodeInfo& message, std::span<std::uint8_t> out, std::size_t& written);

}  // namespace palpate::wire
