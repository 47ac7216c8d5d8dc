// Who and what on the wire: node identifiers, subjects and services (docs/protocol.md).
#pragma once

#include <cstdint>

namespace palpate::wire {

// Node identifiers, unless configured otherwise.
inline constexpr std::uint16_t kBoardNode = 42;
inline constexpr std::uint16_t kHostNode = 10;
inline constexpr std::uint16_t kBroadcast = 0xFFFF;  // as a destination: every node; as a source: anonymous

// Subjects: messages to whoever listens.
inline constexpr std::uint16_t kServoTraceSubject = 1600;    // board to host, palpate.ServoTrace
inline constexpr std::uint16_t kBoardStatusSubject = 1601;   // board to host, palpate.BoardStatus
inline constexpr std::uint16_t kModelReportSubject = 1602;   // board to host, palpate.ModelReport
inline constexpr std::uint16_t kBasisReportSubject = 1603;   // board to host, palpate.BasisReport
inline constexpr std::uint16_t kTipTraceSubject = 1604;      // board to host, palpate.TipTrace
inline constexpr std::uint16_t kDeviceStateSubject = 1605;   // board to host, palpate.DeviceState
inline constexpr std::uint16_t kModelStateSubject = 1610;    // host to board, palpate.ModelState
inline constexpr std::uint16_t kTraceRequestSubject = 1611;  // host to board, palpate.TraceRequest
inline constexpr std::uint16_t kModelPartSubject = 1612;     // host to board, palpate.ModelPart
inline constexpr std::uint16_t kDirectForceSubject = 1613;   // host to board, palpate.DirectForce
// Services of the board: a request and its response.
inline constexpr std::uint16_t kCommandService = 300;  // palpate.Command
inline constexpr std::uint16_t kGetInfoService = 301;  // palpate.GetInfo
// The standard's own, of any node (node.hpp).
inline constexpr std::uint16_t kHeartbeatSubject = 7509;  // uavcan.node.Heartbeat
inline constexpr std::uint16_t kTimeSubject = 7168;       // uavcan.time.Synchronization
inline constexpr std::uint16_t kNodeInfoService = 430;    // uavcan.node.GetInfo
// Those of its registers (registers.hpp).
inline constexpr std::uint16_t kRegisterAccessService = 384;  // uavcan.register.Access
inline constexpr std::uint16_t kRegisterListService = 385;    // uavcan.register.List

// The data specifier of a frame header: the kind of transfer and the number of its subject or service.
constexpr std::uint16_t message_specifier(std::uint16_t subject) {
  return subject;
}
constexpr std::uint16_t response_specifier(std::uint16_t service) {
  return static_cast<std::uint16_t>(0x8000u | service);
}
constexpr std::uint16_t request_specifier(std::uint16_t service) {
  return static_cast<std::uint16_t>(0xC000u | service);
}

// Messages with numbers that the standard has fixed: what nodes say of themselves to everybody, such as
// heartbeats. Nobody has to know them.
constexpr bool is_standard_message(std::uint16_t specifier) {
  return specifier >= 7168 && specifier <= 8191;
}

}  // namespace palpate::wire
