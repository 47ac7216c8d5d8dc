// The host's end of the link: typed messages to frames, and bytes from the board to typed messages. What is
// called a frame here is a whole transfer; on CAN it may take several frames of the bus.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "host/link/framing.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/reception.hpp"
#include "shared/wire/registers.hpp"
#include "shared/wire/transfer_monitor.hpp"

namespace palpate::link {

// One frame as it goes on the wire: on a serial link both delimiters included, on CAN all its records.
struct OutgoingFrame {
  std::vector<std::uint8_t> bytes;
  std::uint64_t transfer_id = 0;  // a response carries its request's
};

struct CommandResponse {
  std::uint64_t transfer_id = 0;  // of the request
  palpate_Command_Response_1_0 message{};
};

struct InfoResponse {
  std::uint64_t transfer_id = 0;
  palpate_GetInfo_Response_1_0 message{};
};

struct RegisterAnswer {
  std::uint64_t transfer_id = 0;
  wire::RegisterAccessResponse message{};
};

struct RegisterName {
  std::uint64_t transfer_id = 0;
  std::string name;  // empty: no register has that index
};

using Incoming = std::variant<palpate_ServoTrace_1_0, palpate_TipTrace_1_0, palpate_BoardStatus_1_0,
                              palpate_ModelReport_1_0, palpate_BasisReport_1_0, palpate_DeviceState_1_0,
                              CommandResponse, InfoResponse, RegisterAnswer, RegisterName>;

struct EndpointCounters {
  std::uint64_t frames_sent = 0;
  std::uint64_t bytes_sent = 0;
  std::uint64_t bytes_received = 0;
  std::uint64_t frames_received = 0;  // good frames, whatever became of them
  std::uint64_t frames_refused = 0;   // bad framing or CRC
  std::uint64_t frames_lost = 0;      // gaps in the board's transfer identifiers: refused frames among them
  std::uint64_t frames_repeated = 0;  // the same transfer again; ignored
  std::uint64_t frames_late = 0;      // behind later ones: taken, and not lost
  std::uint64_t frames_foreign = 0;   // from another node or to another one; ignored
  std::uint64_t ports_unknown = 0;    // from the board, but no message of ours
  std::uint64_t payloads_malformed = 0;  // the decoder refused them, or their numbers say nothing
  std::uint64_t schema_mismatches = 0;   // BoardStatus and GetInfo of a board with other message definitions
};

// For EndpointOptions::first_transfer_id of a program that may start again: by the clock, so far from that of
// an earlier millisecond that receivers take it for a new beginning, not for transfers that were lost.
std::uint64_t fresh_transfer_id();

struct EndpointOptions {
  std::uint16_t node = wire::kHostNode;
  std::uint16_t board = wire::kBoardNode;
  // A host that starts again within 2 s of its last transfers continues their numbers, or the board may take
  // its first ones for repeats (docs/protocol.md).
  std::uint64_t first_transfer_id = 0;
  FramingKind framing = FramingKind::serial;
};

// One thread.
class HostEndpoint {
 public:
  // Throws std::invalid_argument if node and board are the same, or none that the framing can name.
  explicit HostEndpoint(const EndpointOptions& options = {});

  // Encode one frame each; every call is a new transfer. Throw std::invalid_argument, naming field, value and
  // allowed range, for what the wire cannot carry: an array count beyond its bound, a count of ticks
  // outside 0..256, an unknown action or form of trace, ticks of a trace outside 1..32. Values are not
  // judged: a test may send NaN or another schema hash. Pieces of a basis have low priority: on a bus they
  // give way to all else.
  OutgoingFrame encode(const palpate_ModelPart_1_0& message);
  OutgoingFrame encode(const palpate_ModelState_1_0& message);
  OutgoingFrame encode(const palpate_TraceRequest_1_0& message);
  OutgoingFrame encode(const palpate_DirectForce_1_0& message);
  OutgoingFrame encode(const palpate_Command_Request_1_0& message);
  OutgoingFrame encode(const palpate_GetInfo_Request_1_0& message);
  // Also for a name that is empty or longer than wire::kMaxRegisterName, and too many values.
  OutgoingFrame encode(const wire::RegisterAccessRequest& message);
  OutgoingFrame encode(const wire::RegisterListRequest& message);
  // Any payload under any specifier (wire/ports.hpp): for tests of what the board refuses.
  OutgoingFrame encode_payload(std::uint16_t specifier, std::span<const std::uint8_t> payload);

  // Takes bytes as they came, in pieces of any length; returns the messages that they completed, in order.
  // Whatever is wrong is counted and left out; nothing throws. `tick`: now, for telling repeats from a board
  // that started again.
  // Of a response over CAN, which carries 5 bits of its request's transfer identifier, it is taken for that
  // of the newest request that it can answer.
  std::vector<Incoming> receive(std::span<const std::uint8_t> bytes, std::uint32_t tick);

  [[nodiscard]] EndpointCounters counters() const;
  // Faults by kind (Status).
  [[nodiscard]] const wire::ReceiverCounters& receiver_counters() const { return framing_->counters(); }

 private:
  [[nodiscard]] std::uint64_t request_of(const wire::FrameHeader& response) const;
  template <class Message>
  OutgoingFrame encode_message(const Message& message);
  void take(wire::Frame frame, std::uint32_t tick, std::vector<Incoming>& messages);

  EndpointOptions options_;
  std::map<std::uint16_t, std::uint64_t> next_transfer_id_;  // by specifier
  std::unique_ptr<Framing> framing_;
  wire::TransferMonitor transfers_;
  EndpointCounters counters_;
};

}  // namespace palpate::link
