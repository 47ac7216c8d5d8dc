#include "host/link/host_endpoint.hpp"

#include <chrono>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "shared/wire/can_frame.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::link {
namespace {

// Bits of a specifier (wire/ports.hpp).
constexpr std::uint16_t kServiceBit = 0x8000u, kRequestBit = 0x4000u;

void check_range(const char* field, std::size_t value, std::size_t least, std::size_t most) {
  if (value < least || value > most)
    throw std::invalid_argument(std::string(field) + " is " + std::to_string(value) + ", allowed " +
                                std::to_string(least) + ".." + std::to_string(most));
}

// Do the numbers of a message that can be decoded say anything?
template <class Message>
bool is_good(const Message&) {
  return true;
}
bool is_good(const palpate_ServoTrace_1_0& message) {
  for (std::size_t i = 0; i < message.samples.count; ++i)
    for (const float coordinate_m : message.samples.elements[i].tip_m)
      if (!std::isfinite(coordinate_m)) return false;
  return true;
}
bool is_good(const palpate_DeviceState_1_0& message) {
  bool good = true;
  for (std::size_t i = 0; i < 3; ++i)
    good = good && std::isfinite(message.tip_m[i]) && std::isfinite(message.velocity_m_s[i]) &&
           std::isfinite(message.force_N[i]);
  return good;
}
bool is_good(const palpate_TipTrace_1_0& message) {
  return wire::check_tips(message) == Status::ok;
}

template <class Message>
bool decode(const wire::Frame& frame, std::vector<Incoming>& messages) {
  Message message{};
  if (wire::deserialize(frame.payload, message) != Status::ok || !is_good(message)) return false;
  messages.emplace_back(message);
  return true;
}

template <class Response>
bool decode_response(const wire::Frame& frame, std::vector<Incoming>& messages) {
  Response response{.transfer_id = frame.header.transfer_id};
  if (wire::deserialize(frame.payload, response.message) != Status::ok) return false;
  messages.emplace_back(response);
  return true;
}

// Its name is a view of the frame.
bool decode_register_name(const wire::Frame& frame, std::vector<Incoming>& messages) {
  wire::RegisterListResponse response;
  if (wire::deserialize(frame.payload, response) != Status::ok) return false;
  messages.emplace_back(
      RegisterName{.transfer_id = frame.header.transfer_id, .name = std::string(response.name)});
  return true;
}

// The hash of the board's message definitions, if the message tells it.
std::optional<std::uint64_t> announced_schema_hash(const Incoming& message) {
  if (const auto* status = std::get_if<palpate_BoardStatus_1_0>(&message)) return status->schema_hash;
  if (const auto* info = std::get_if<InfoResponse>(&message)) return info->message.schema_hash;
  return std::nullopt;
}

}  // namespace

std::uint64_t fresh_transfer_id() {
  constexpr unsigned kBeyondLosses = 17;  // wire::TransferMonitor counts up to 65,536 as lost
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(now).count())
         << kBeyondLosses;
}

HostEndpoint::HostEndpoint(const EndpointOptions& options)
    : options_(options), framing_(make_framing(options.framing)), transfers_(framing_->transfer_id_bits()) {
  const std::uint16_t most =
      options.framing == FramingKind::serial ? wire::kBroadcast - 1 : wire::kMaxCanNode;
  if (options.node > most || options.board > most || options.node == options.board)
    throw std::invalid_argument("HostEndpoint: node " + std::to_string(options.node) + " and board " +
                                std::to_string(options.board) + " must differ and be in 0.." +
                                std::to_string(most));
}

OutgoingFrame HostEndpoint::encode(const palpate_ModelPart_1_0& message) {
  check_range("ModelPart.data.count", message.data.count, 0, palpate_ModelPart_1_0_data_ARRAY_CAPACITY_);
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const palpate_ModelState_1_0& message) {
  check_range("ModelState.displacement.count", message.displacement.count, 0, 3 * kMaxSurfaceNodes);
  check_range("ModelState.load.count", message.load.count, 0, kMaxModes);
  check_range("ModelState.q.count", message.q.count, 0, kMaxModes);
  check_range("ModelState.p.count", message.p.count, 0, kMaxModes);
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const palpate_TraceRequest_1_0& message) {
  constexpr std::size_t kMostTicks = 256;  // palpate.TraceRequest
  check_range("TraceRequest.count", message.count, 0, kMostTicks);
  check_range("TraceRequest.form", message.form, palpate_TraceRequest_1_0_FORM_FULL,
              palpate_TraceRequest_1_0_FORM_DEVICE);
  check_range("TraceRequest.ticks", message.ticks, 1, wire::kMaxTraceTicks);
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const palpate_Command_Request_1_0& message) {
  check_range("Command.action", message.action, palpate_Command_Request_1_0_NOTHING,
              palpate_Command_Request_1_0_ARM_DIRECT);
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const palpate_DirectForce_1_0& message) {
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const palpate_GetInfo_Request_1_0& message) {
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const wire::RegisterAccessRequest& message) {
  check_range("register.Access name, characters", message.name.size(), 1, wire::kMaxRegisterName);
  check_range("register.Access value, elements", message.value.count, 0, wire::kMaxRegisterValues);
  return encode_message(message);
}

OutgoingFrame HostEndpoint::encode(const wire::RegisterListRequest& message) {
  return encode_message(message);
}

template <class Message>
OutgoingFrame HostEndpoint::encode_message(const Message& message) {
  std::vector<std::uint8_t> payload(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  if (wire::serialize(message, payload, length) != Status::ok)
    throw std::logic_error("HostEndpoint: a checked message cannot be serialized");
  return encode_payload(wire::MessageTraits<Message>::kSpecifier, std::span(payload).first(length));
}

OutgoingFrame HostEndpoint::encode_payload(std::uint16_t specifier, std::span<const std::uint8_t> payload) {
  const bool service = (specifier & kServiceBit) != 0;
  const auto [next, first] = next_transfer_id_.try_emplace(specifier, options_.first_transfer_id);
  const bool yields = specifier == wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier;
  const wire::Priority messages = yields ? wire::Priority::low : wire::Priority::nominal;
  const wire::FrameHeader header{.priority = service ? wire::Priority::high : messages,
                                 .source = options_.node,
                                 .destination = service ? options_.board : wire::kBroadcast,
                                 .specifier = specifier,
                                 .transfer_id = next->second};
  OutgoingFrame frame{.bytes = framing_->encode(header, payload), .transfer_id = next->second++};
  ++counters_.frames_sent;
  counters_.bytes_sent += frame.bytes.size();
  return frame;
}

std::vector<Incoming> HostEndpoint::receive(std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  counters_.bytes_received += bytes.size();
  std::vector<Incoming> messages;
  while (true) {
    const wire::Reception reception = framing_->receive(bytes, tick);
    bytes = bytes.subspan(reception.consumed);
    if (!reception.complete) return messages;
    take(reception.frame, tick, messages);
  }
}

std::uint64_t HostEndpoint::request_of(const wire::FrameHeader& response) const {
  const auto next = next_transfer_id_.find(static_cast<std::uint16_t>(response.specifier | kRequestBit));
  if (next == next_transfer_id_.end()) return response.transfer_id;
  const std::uint64_t mask = ~std::uint64_t{0} >> (64 - framing_->transfer_id_bits());
  const std::uint64_t newest = next->second - 1;
  return newest - ((newest - response.transfer_id) & mask);
}

void HostEndpoint::take(wire::Frame frame, std::uint32_t tick, std::vector<Incoming>& messages) {
  if (frame.header.source != options_.board || !wire::addressed_to(frame.header, options_.node)) {
    ++counters_.frames_foreign;
    return;
  }
  if (transfers_.observe(frame.header, tick) == wire::TransferKind::repeat) return;
  const std::uint16_t specifier = frame.header.specifier;
  if ((specifier & kServiceBit) != 0 && (specifier & kRequestBit) == 0 && framing_->transfer_id_bits() < 64)
    frame.header.transfer_id = request_of(frame.header);
  bool decoded = false;
  switch (specifier) {
    case wire::MessageTraits<palpate_ServoTrace_1_0>::kSpecifier:
      decoded = decode<palpate_ServoTrace_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_TipTrace_1_0>::kSpecifier:
      decoded = decode<palpate_TipTrace_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_BoardStatus_1_0>::kSpecifier:
      decoded = decode<palpate_BoardStatus_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_ModelReport_1_0>::kSpecifier:
      decoded = decode<palpate_ModelReport_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_BasisReport_1_0>::kSpecifier:
      decoded = decode<palpate_BasisReport_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_DeviceState_1_0>::kSpecifier:
      decoded = decode<palpate_DeviceState_1_0>(frame, messages);
      break;
    case wire::MessageTraits<palpate_Command_Response_1_0>::kSpecifier:
      decoded = decode_response<CommandResponse>(frame, messages);
      break;
    case wire::MessageTraits<palpate_GetInfo_Response_1_0>::kSpecifier:
      decoded = decode_response<InfoResponse>(frame, messages);
      break;
    case wire::MessageTraits<wire::RegisterAccessResponse>::kSpecifier:
      decoded = decode_response<RegisterAnswer>(frame, messages);
      break;
    case wire::MessageTraits<wire::RegisterListResponse>::kSpecifier:
      decoded = decode_register_name(frame, messages);
      break;
    default:
      if (wire::is_standard_message(specifier)) return;  // a heartbeat
      ++counters_.ports_unknown;
      return;
  }
  if (!decoded) {
    ++counters_.payloads_malformed;
    return;
  }
  const std::optional<std::uint64_t> hash = announced_schema_hash(messages.back());
  if (hash && *hash != wire::kSchemaHash) ++counters_.schema_mismatches;
}

EndpointCounters HostEndpoint::counters() const {
  EndpointCounters counters = counters_;
  counters.frames_received = framing_->counters().frames;
  counters.frames_refused = framing_->counters().refused();
  counters.frames_lost = transfers_.lost();
  counters.frames_repeated = transfers_.repeated();
  counters.frames_late = transfers_.late();
  return counters;
}

}  // namespace palpate::link
