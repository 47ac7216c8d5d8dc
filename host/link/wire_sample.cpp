// wire_sample hash | write FRAMING | parse FRAMING: a peer for clients of the wire protocol that are written
// independently. FRAMING: serial, can_classic or can_fd.
//   hash   prints the schema hash, hexadecimal
//   write  writes one transfer of each message to standard output; the values are those of sample_*() below
//   parse  reads bytes from standard input; prints one JSON object a transfer, then one with the receiver's
//   counters

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host/link/framing.hpp"
#include "host/link/host_endpoint.hpp"
#include "shared/wire/tip_trace.hpp"

namespace {

using namespace palpate;

void write(std::span<const std::uint8_t> bytes) {
  std::fwrite(bytes.data(), 1, bytes.size(), stdout);
}

// A frame as the board sends it.
template <class Message>
void write_from_board(const link::Framing& framing, const Message& message, std::uint16_t destination,
                      std::uint64_t transfer_id) {
  std::vector<std::uint8_t> payload(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  if (wire::serialize(message, payload, length) != Status::ok) std::abort();
  write(framing.encode({.priority = wire::Priority::nominal,
                        .source = wire::kBoardNode,
                        .destination = destination,
                        .specifier = wire::MessageTraits<Message>::kSpecifier,
                        .transfer_id = transfer_id},
                       std::span(payload).first(length)));
}

palpate_ServoTrace_1_0 sample_trace() {
  palpate_ServoTrace_1_0 trace{.sequence = 3, .first_tick = 1000, .samples = {}};
  trace.samples.count = 10;
  for (std::size_t i = 0; i < trace.samples.count; ++i) {
    const float value = static_cast<float>(i);
    trace.samples.elements[i] = {.tip_m = {0.25f * value, -0.5f, 0.0f},
                                 .force_N = {0.0f, 1.0f, -0.125f * value},
                                 .mode = palpate_Contact_1_0_MODE_STICK,
                                 .flags = palpate_ServoSample_1_0_FLAG_RENDERING,
                                 .triangle = static_cast<std::uint16_t>(300 + i)};
  }
  return trace;
}

// Steps of 2^-15 m.
palpate_TipTrace_1_0 sample_tip_trace() {
  std::array<Vec3f, 8> tip_m;
  for (std::size_t i = 0; i < tip_m.size(); ++i) tip_m[i] = {0.125f * static_cast<float>(i), -0.5f, 0.0f};
  palpate_TipTrace_1_0 trace{};
  trace.first_tick = 1010;
  if (wire::write_tips(tip_m, trace) != Status::ok) std::abort();
  return trace;
}

palpate_BoardStatus_1_0 sample_status() {
  palpate_BoardStatus_1_0 status{};
  status.sequence = 4;
  status.schema_hash = wire::kSchemaHash;
  status.tick = 1100;
  status.mode = palpate_BoardStatus_1_0_MODE_RENDER;
  status._token = 0xDEADBEEFu;
  status.worst_tick_count = 5000;
  status.clock_Hz = 25'000'000;
  status.trace_form = palpate_TraceRequest_1_0_FORM_TIP;
  status.trace_ticks = 8;
  return status;
}

// The largest state: every array full.
palpate_ModelState_1_0 sample_state() {
  palpate_ModelState_1_0 state{};
  state.sequence = 5;
  state.schema_hash = wire::kSchemaHash;
  state.tick = 990;
  state.basis_id = 0xCAFEBABEu;
  state.q_step_m = 0.5f;
  const auto fill = [](auto& array) {
    array.count = std::size(array.elements);
    for (std::size_t i = 0; i < array.count; ++i)
      array.elements[i] = static_cast<std::int16_t>(100 * static_cast<int>(i) - 4608);
  };
  fill(state.displacement);
  fill(state.load);
  fill(state.q);
  fill(state.p);
  return state;
}

palpate_ModelPart_1_0 sample_part() {
  palpate_ModelPart_1_0 part{.basis_id = 0xCAFEBABEu, .basis_bytes = 13'000, .first_block = 8, .data = {}};
  part.data.count = std::size(part.data.elements);
  for (std::size_t i = 0; i < part.data.count; ++i) part.data.elements[i] = static_cast<std::uint8_t>(i);
  return part;
}

palpate_BasisReport_1_0 sample_basis_report() {
  palpate_BasisReport_1_0 report{
      .basis_id = 0xCAFEBABEu, .status = 38, .basis_bytes = 13'000, .missing = {}, .held = {}};
  report.missing.count = 7;
  report.missing.elements[6] = 0x05;
  report.held.count = 2;
  report.held.elements[0] = 11;
  report.held.elements[1] = 12;
  return report;
}

palpate_GetInfo_Response_1_0 sample_info() {
  palpate_GetInfo_Response_1_0 info{};
  info.schema_hash = wire::kSchemaHash;
  constexpr std::string_view kBoard = "sample";
  std::copy(kBoard.begin(), kBoard.end(), info.board.elements);
  info.board.count = kBoard.size();
  info.max_modes = kMaxModes;
  info.tick_rate_Hz = 1000;
  return info;
}

palpate_DeviceState_1_0 sample_device_state() {
  return {.tick = 1200,
          .tip_m = {0.125f, -0.5f, 0.0f},
          .velocity_m_s = {0.0f, 0.25f, -1.0f},
          .force_N = {0.0f, 0.0f, 2.5f},
          .mode = palpate_BoardStatus_1_0_MODE_DIRECT,
          .flags = palpate_ServoSample_1_0_FLAG_DIRECT,
          .faults = 0x0102};
}

void write_samples(link::FramingKind kind) {
  link::HostEndpoint host({.framing = kind});
  const std::unique_ptr<link::Framing> board = link::make_framing(kind);
  write_from_board(*board, sample_trace(), wire::kBroadcast, 3);
  write_from_board(*board, sample_tip_trace(), wire::kBroadcast, 5);
  write_from_board(*board, sample_status(), wire::kBroadcast, 4);
  write_from_board(
      *board,
      palpate_ModelReport_1_0{
          .sequence = 5, .status = 0, .model_tick = 990, .swap_tick = 1010, .correction_energy_J = -0.125f},
      wire::kBroadcast, 6);
  write_from_board(*board, palpate_Command_Response_1_0{.status = 0, .mode = 1, ._token = 77},
                   wire::kHostNode, 0);
  write_from_board(*board, sample_info(), wire::kHostNode, 0);
  write_from_board(*board, sample_basis_report(), wire::kBroadcast, 2);
  write_from_board(*board, sample_device_state(), wire::kBroadcast, 7);
  write(host.encode(palpate_DirectForce_1_0{.force_N = {0.5f, -0.25f, 1.0f}}).bytes);
  write(host.encode(sample_state()).bytes);
  write(host.encode(sample_part()).bytes);
  write(
      host.encode(palpate_TraceRequest_1_0{
                      .first_tick = 950, .count = 40, .form = palpate_TraceRequest_1_0_FORM_TIP, .ticks = 8})
          .bytes);
  write(host.encode(
                palpate_Command_Request_1_0{.action = palpate_Command_Request_1_0_ARM_CONFIRM, ._token = 77})
            .bytes);
  write(host.encode(palpate_GetInfo_Request_1_0{}).bytes);
}

std::string hex(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xF];
  }
  return text;
}

// The payload decoded and encoded again, hexadecimal; empty if it was refused.
template <class Message>
std::string again(std::span<const std::uint8_t> payload) {
  const auto message = std::make_unique<Message>();
  std::vector<std::uint8_t> bytes(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  if (wire::deserialize(payload, *message) != Status::ok) return {};
  if (wire::serialize(*message, bytes, length) != Status::ok) return {};
  return hex(std::span(bytes).first(length));
}

template <class... Messages>
std::string again_by_specifier(const wire::Frame& frame) {
  std::string text;
  ((frame.header.specifier == wire::MessageTraits<Messages>::kSpecifier
        ? text = again<Messages>(frame.payload)
        : text),
   ...);
  return text;
}

void print(const wire::Frame& frame) {
  const std::string decoded =
      again_by_specifier<palpate_ServoTrace_1_0, palpate_TipTrace_1_0, palpate_BoardStatus_1_0,
                         palpate_ModelReport_1_0, palpate_BasisReport_1_0, palpate_ModelState_1_0,
                         palpate_ModelPart_1_0, palpate_TraceRequest_1_0, palpate_DirectForce_1_0,
                         palpate_DeviceState_1_0, palpate_Command_Request_1_0, palpate_Command_Response_1_0,
                         palpate_GetInfo_Request_1_0, palpate_GetInfo_Response_1_0>(frame);
  std::printf(
      "{\"priority\": %u, \"source\": %u, \"destination\": %u, \"specifier\": %u, \"transfer_id\": %llu, "
      "\"payload\": \"%s\", \"decoded\": \"%s\"}\n",
      static_cast<unsigned>(frame.header.priority), frame.header.source, frame.header.destination,
      frame.header.specifier, static_cast<unsigned long long>(frame.header.transfer_id),
      hex(frame.payload).c_str(), decoded.c_str());
}

void parse_input(link::FramingKind kind) {
  const std::unique_ptr<link::Framing> receiver = link::make_framing(kind);
  std::array<std::uint8_t, 4096> buffer{};
  for (std::size_t got = 1; got != 0;) {
    got = std::fread(buffer.data(), 1, buffer.size(), stdin);
    std::span<const std::uint8_t> bytes = std::span<const std::uint8_t>(buffer).first(got);
    while (true) {
      const wire::Reception reception = receiver->receive(bytes, 0);
      bytes = bytes.subspan(reception.consumed);
      if (!reception.complete) break;
      print(reception.frame);
    }
  }
  std::printf("{\"frames\": %u, \"refused\": %u}\n", receiver->counters().frames,
              receiver->counters().refused());
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view command = argc >= 2 ? argv[1] : "", framing = argc == 3 ? argv[2] : "";
  std::optional<link::FramingKind> kind;
  if (framing == "serial") kind = link::FramingKind::serial;
  if (framing == "can_classic") kind = link::FramingKind::can_classic;
  if (framing == "can_fd") kind = link::FramingKind::can_fd;
  if (command == "hash" && argc == 2) {
    std::printf("%016llx\n", static_cast<unsigned long long>(wire::kSchemaHash));
  } else if (command == "write" && kind) {
    write_samples(*kind);
  } else if (command == "parse" && kind) {
    parse_input(*kind);
  } else {
    std::fputs(
        "usage: wire_sample hash | write FRAMING | parse FRAMING\n"
        "FRAMING: serial, can_classic or can_fd\n",
        stderr);
    return 2;
  }
  return 0;
}
