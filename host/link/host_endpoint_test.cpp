#include "host/link/host_endpoint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>
#include <string>

#include "host/link/fault_plan.hpp"
#include "host/link/uart.hpp"
#include "shared/wire/frame_receiver.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

// The board's side of the frames.
template <class Message>
Bytes from_board(const Message& message, std::uint64_t transfer_id, std::uint16_t source = wire::kBoardNode,
                 std::uint16_t destination = wire::kBroadcast) {
  Bytes payload(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  EXPECT_EQ(wire::serialize(message, payload, length), Status::ok);
  Bytes frame(wire::max_frame_bytes(length));
  frame.resize(wire::encode_frame({.source = source,
                                   .destination = destination,
                                   .specifier = wire::MessageTraits<Message>::kSpecifier,
                                   .transfer_id = transfer_id},
                                  std::span(payload).first(length), frame));
  return frame;
}

palpate_ServoTrace_1_0 trace(std::uint32_t sequence, std::size_t samples = 10) {
  palpate_ServoTrace_1_0 message{};
  message.sequence = sequence;
  message.first_tick = 10 * sequence;
  message.samples.count = samples;
  for (std::size_t i = 0; i < samples; ++i)
    message.samples.elements[i].tip_m[2] = 0.25f * static_cast<float>(i);
  return message;
}

// What a board's receiver makes of the host's frame.
template <class Message>
Message as_board(const Bytes& bytes, wire::FrameHeader& header) {
  auto receiver = std::make_unique<wire::FrameReceiver<wire::kLargestPayloadToBoard>>();
  const wire::Reception reception = receiver->receive(bytes);
  Message message{};
  EXPECT_TRUE(reception.complete);
  EXPECT_EQ(reception.consumed, bytes.size());
  header = reception.frame.header;
  EXPECT_EQ(header.specifier, wire::MessageTraits<Message>::kSpecifier);
  EXPECT_EQ(wire::deserialize(reception.frame.payload, message), Status::ok);
  return message;
}

TEST(HostEndpoint, MessagesToTheBoard) {
  HostEndpoint host;
  wire::FrameHeader header;
  for (std::uint64_t id = 0; id < 3; ++id) {
    const OutgoingFrame frame =
        host.encode(palpate_TraceRequest_1_0{.first_tick = 500, .count = 256, .form = 1, .ticks = 8});
    const auto request = as_board<palpate_TraceRequest_1_0>(frame.bytes, header);
    EXPECT_EQ(request.first_tick, 500u);
    EXPECT_EQ(request.count, 256u);
    EXPECT_EQ(header.source, wire::kHostNode);
    EXPECT_EQ(header.destination, wire::kBroadcast);
    EXPECT_EQ(header.transfer_id, id);
    EXPECT_EQ(frame.transfer_id, id);
  }
  const OutgoingFrame command = host.encode(
      palpate_Command_Request_1_0{.action = palpate_Command_Request_1_0_ARM_CONFIRM, ._token = 9});
  EXPECT_EQ(as_board<palpate_Command_Request_1_0>(command.bytes, header)._token, 9u);
  EXPECT_EQ(header.destination, wire::kBoardNode);
  EXPECT_EQ(header.transfer_id, 0u);  // each specifier has its own count
  as_board<palpate_GetInfo_Request_1_0>(host.encode(palpate_GetInfo_Request_1_0{}).bytes, header);

  palpate_ModelState_1_0 state{};
  state.p.count = kMaxModes;
  state.p.elements[kMaxModes - 1] = -12345;
  const OutgoingFrame frame = host.encode(state);
  EXPECT_EQ(as_board<palpate_ModelState_1_0>(frame.bytes, header).p.elements[kMaxModes - 1], -12345);
  palpate_ModelPart_1_0 part{};
  part.data.count = 1024;
  part.data.elements[1023] = 7;
  EXPECT_EQ(header.priority, wire::Priority::nominal);
  EXPECT_EQ(as_board<palpate_ModelPart_1_0>(host.encode(part).bytes, header).data.elements[1023], 7);
  EXPECT_EQ(header.priority, wire::Priority::low);  // it gives way on a bus
  EXPECT_EQ(host.counters().frames_sent, 7u);
}

TEST(HostEndpoint, MessagesFromTheBoardInTheirOrder) {
  HostEndpoint host;
  palpate_GetInfo_Response_1_0 info{};
  info.schema_hash = wire::kSchemaHash;
  Bytes stream;
  const auto append = [&stream](const Bytes& bytes) {
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  };
  append(from_board(trace(1, 32), 0));
  palpate_TipTrace_1_0 tips{};
  tips.first_tick = 42;
  tips.step_exponent = -20;
  tips.offsets.count = 7;
  append(from_board(tips, 0));
  palpate_BoardStatus_1_0 status{};
  status.sequence = 2;
  append(from_board(status, 0));
  palpate_ModelReport_1_0 report{};
  report.status = 35;
  append(from_board(report, 0));
  palpate_BasisReport_1_0 basis{};
  basis.basis_id = 77;
  append(from_board(basis, 0));
  append(from_board(palpate_Command_Response_1_0{.status = 49, .mode = 1, ._token = 0}, 4, wire::kBoardNode,
                    wire::kHostNode));
  append(from_board(info, 5, wire::kBoardNode, wire::kHostNode));

  std::vector<Incoming> messages;
  for (const std::uint8_t byte : stream)
    for (Incoming& message : host.receive(std::span(&byte, 1), 0)) messages.push_back(message);
  ASSERT_EQ(messages.size(), 7u);
  EXPECT_EQ(std::get<palpate_ServoTrace_1_0>(messages[0]).samples.elements[31].tip_m[2], 7.75f);
  EXPECT_EQ(std::get<palpate_TipTrace_1_0>(messages[1]).first_tick, 42u);
  EXPECT_EQ(std::get<palpate_BoardStatus_1_0>(messages[2]).sequence, 2u);
  EXPECT_EQ(std::get<palpate_ModelReport_1_0>(messages[3]).status, 35u);
  EXPECT_EQ(std::get<palpate_BasisReport_1_0>(messages[4]).basis_id, 77u);
  EXPECT_EQ(std::get<CommandResponse>(messages[5]).transfer_id, 4u);
  EXPECT_EQ(std::get<CommandResponse>(messages[5]).message.status, 49u);
  EXPECT_EQ(std::get<InfoResponse>(messages[6]).message.schema_hash, wire::kSchemaHash);
  EXPECT_EQ(host.counters().frames_received, 7u);
  EXPECT_EQ(host.counters().frames_lost, 0u);
  EXPECT_EQ(host.counters().bytes_received, stream.size());
}

TEST(HostEndpoint, WhatIsNotForItIsCountedAndLeftOut) {
  HostEndpoint host;
  EXPECT_TRUE(host.receive(from_board(trace(1), 0, 43), 0).empty());
  EXPECT_TRUE(host.receive(from_board(trace(1), 0, wire::kBoardNode, 11), 0).empty());
  EXPECT_EQ(host.counters().frames_foreign, 2u);
  EXPECT_TRUE(
      host.receive(
              from_board(palpate_TraceRequest_1_0{.first_tick = 0, .count = 1, .form = 0, .ticks = 4}, 0), 0)
          .empty());
  EXPECT_EQ(host.counters().ports_unknown, 1u);
  Bytes heartbeat(64);
  heartbeat.resize(wire::encode_frame({.source = wire::kBoardNode, .specifier = wire::kHeartbeatSubject},
                                      Bytes(7), heartbeat));
  EXPECT_TRUE(host.receive(heartbeat, 0).empty());
  EXPECT_EQ(host.counters().ports_unknown, 1u);

  Bytes frame(200);
  const Bytes short_payload(8, 1);
  frame.resize(wire::encode_frame({.source = wire::kBoardNode, .specifier = wire::kServoTraceSubject},
                                  short_payload, frame));
  EXPECT_TRUE(host.receive(frame, 0).empty());
  EXPECT_EQ(host.counters().payloads_malformed, 1u);

  EXPECT_EQ(host.receive(from_board(trace(1), 1), 0).size(), 1u);
  EXPECT_TRUE(host.receive(from_board(trace(1), 1), 0).empty());
  EXPECT_EQ(host.counters().frames_repeated, 1u);
  EXPECT_EQ(host.counters().frames_refused, 0u);
}

// Tips that say nothing are lost tips: counted, and nobody hears of them.
TEST(HostEndpoint, TipsThatSayNothingAreRefused) {
  HostEndpoint host;
  palpate_TipTrace_1_0 good{};
  good.step_exponent = -20;
  good.offsets.count = 3;
  palpate_TipTrace_1_0 bad = good;
  bad.step_exponent = -11;
  EXPECT_TRUE(host.receive(from_board(bad, 0), 0).empty());
  bad = good;
  bad.tip_m[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(host.receive(from_board(bad, 1), 0).empty());
  palpate_ServoTrace_1_0 full = trace(1);
  full.samples.elements[9].tip_m[2] = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(host.receive(from_board(full, 0), 0).empty());
  // More offsets than there can be: the length's byte, behind 17 others, says so.
  Bytes payload(400), frame(500);
  payload[16] = 0xEC;  // -20
  payload[17] = 32;
  frame.resize(wire::encode_frame(
      {.source = wire::kBoardNode, .specifier = wire::kTipTraceSubject, .transfer_id = 2}, payload, frame));
  EXPECT_TRUE(host.receive(frame, 0).empty());
  EXPECT_EQ(host.counters().payloads_malformed, 4u);
  EXPECT_EQ(host.receive(from_board(good, 3), 0).size(), 1u);
  EXPECT_EQ(host.counters().payloads_malformed, 4u);
}

void expect_refused(const std::string& expected, const auto& call) {
  try {
    call();
    ADD_FAILURE() << "not refused: " << expected;
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(error.what(), expected);
  }
}

TEST(HostEndpoint, UnencodableMessagesNameFieldValueAndRange) {
  HostEndpoint host;
  palpate_ModelState_1_0 state{};
  state.displacement.count = 97;
  expect_refused("ModelState.displacement.count is 97, allowed 0..96", [&] { host.encode(state); });
  state.displacement.count = 0;
  state.q.count = 193;
  expect_refused("ModelState.q.count is 193, allowed 0..192", [&] { host.encode(state); });
  palpate_ModelPart_1_0 part{};
  part.data.count = 1025;
  expect_refused("ModelPart.data.count is 1025, allowed 0..1024", [&] { host.encode(part); });
  const auto request = [&](std::uint16_t count, std::uint8_t form, std::uint8_t ticks) {
    return
        [&host, message = palpate_TraceRequest_1_0{
                    .first_tick = 0, .count = count, .form = form, .ticks = ticks}] { host.encode(message); };
  };
  expect_refused("TraceRequest.count is 257, allowed 0..256", request(257, 0, 4));
  expect_refused("TraceRequest.form is 3, allowed 0..2", request(1, 3, 4));
  expect_refused("TraceRequest.ticks is 0, allowed 1..32", request(1, 0, 0));
  expect_refused("TraceRequest.ticks is 33, allowed 1..32", request(1, 0, 33));
  expect_refused("Command.action is 8, allowed 0..7",
                 [&] { host.encode(palpate_Command_Request_1_0{.action = 8, ._token = 0}); });
  EXPECT_EQ(host.counters().frames_sent, 0u);
  EXPECT_THROW(HostEndpoint(EndpointOptions{.node = 5, .board = 5}), std::invalid_argument);
}

TEST(HostEndpoint, BoardWithOtherDefinitionsIsNoticed) {
  HostEndpoint host;
  palpate_BoardStatus_1_0 status{};
  status.schema_hash = wire::kSchemaHash;
  EXPECT_EQ(host.receive(from_board(status, 0), 0).size(), 1u);
  EXPECT_EQ(host.counters().schema_mismatches, 0u);
  status.schema_hash = wire::kSchemaHash + 1;
  EXPECT_EQ(host.receive(from_board(status, 1), 0).size(), 1u);
  palpate_GetInfo_Response_1_0 info{};
  EXPECT_EQ(host.receive(from_board(info, 0, wire::kBoardNode, wire::kHostNode), 0).size(), 1u);
  EXPECT_EQ(host.counters().schema_mismatches, 2u);
}

// Values are the board's to judge: NaN and a wrong schema pass the encoder.
TEST(HostEndpoint, ValuesPassUnjudged) {
  HostEndpoint host;
  palpate_ModelState_1_0 state{};
  state.schema_hash = ~wire::kSchemaHash;
  state.q_step_m = std::numeric_limits<float>::quiet_NaN();
  wire::FrameHeader header;
  const auto seen = as_board<palpate_ModelState_1_0>(host.encode(state).bytes, header);
  EXPECT_TRUE(seen.q_step_m != seen.q_step_m);
  EXPECT_EQ(seen.schema_hash, ~wire::kSchemaHash);
}

// The whole path at 921,600 baud: 100 traces with faults on some of them; the others arrive, and every loss
// is counted.
TEST(HostEndpoint, LossesOnTheWayAreCounted) {
  HostEndpoint host;
  Uart uart(921'600);
  const std::array<Fault, 5> faults{Fault{3, FaultKind::drop, 0}, Fault{10, FaultKind::flip_bit, 333},
                                    Fault{20, FaultKind::truncate, 50}, Fault{30, FaultKind::duplicate, 0},
                                    Fault{40, FaultKind::drop, 0}};
  FaultPlan plan(faults);
  std::vector<std::uint32_t> sequences;
  for (std::uint32_t tick = 0; tick < 1010; ++tick) {
    for (const Incoming& message : host.receive(uart.deliver(tick), tick))
      sequences.push_back(std::get<palpate_ServoTrace_1_0>(message).sequence);
    if (tick % 10 == 0 && tick < 1000) {
      ASSERT_TRUE(uart.submit(plan.apply(from_board(trace(tick / 10), tick / 10)), tick));
    }
  }
  std::vector<std::uint32_t> expected;
  for (std::uint32_t sequence = 0; sequence < 100; ++sequence)
    if (sequence != 3 && sequence != 10 && sequence != 20 && sequence != 40) expected.push_back(sequence);
  EXPECT_EQ(sequences, expected);
  const EndpointCounters counters = host.counters();
  EXPECT_EQ(counters.frames_lost, 4u);
  EXPECT_EQ(counters.frames_refused, 2u);
  EXPECT_EQ(counters.frames_repeated, 1u);
  EXPECT_EQ(plan.faults_applied().sum(), faults.size());
}

// Over CAN: the board's side of the transfers.
class CanHost : public testing::TestWithParam<FramingKind> {
 protected:
  template <class Message>
  Bytes from_board(const Message& message, std::uint64_t transfer_id) {
    constexpr std::uint16_t kSpecifier = wire::MessageTraits<Message>::kSpecifier;
    Bytes payload(wire::MessageTraits<Message>::kMaxBytes);
    std::size_t length = 0;
    EXPECT_EQ(wire::serialize(message, payload, length), Status::ok);
    const bool service = kSpecifier >= 0x8000u;
    return board_->encode({.source = wire::kBoardNode,
                           .destination = service ? wire::kHostNode : wire::kBroadcast,
                           .specifier = kSpecifier,
                           .transfer_id = transfer_id},
                          std::span(payload).first(length));
  }
  // The transfers that the board receives.
  template <class Message>
  Message as_board(const Bytes& bytes, wire::FrameHeader& header) {
    const wire::Reception reception = board_->receive(bytes, 0);
    Message message{};
    EXPECT_TRUE(reception.complete);
    EXPECT_EQ(reception.consumed, bytes.size());
    header = reception.frame.header;
    EXPECT_EQ(header.specifier, wire::MessageTraits<Message>::kSpecifier);
    EXPECT_EQ(wire::deserialize(reception.frame.payload, message), Status::ok);
    return message;
  }

  std::unique_ptr<Framing> board_ = make_framing(GetParam());
};

TEST_P(CanHost, MessagesToTheBoard) {
  HostEndpoint host({.framing = GetParam()});
  wire::FrameHeader header;
  palpate_ModelState_1_0 state{};
  state.p.count = state.q.count = state.load.count = kMaxModes;
  state.displacement.count = 3 * kMaxSurfaceNodes;
  for (std::size_t i = 0; i < kMaxModes; ++i) state.p.elements[i] = static_cast<std::int16_t>(37 * i);
  for (std::uint64_t id = 0; id < 70; ++id) {
    const OutgoingFrame frame = host.encode(state);
    EXPECT_EQ(frame.transfer_id, id);
    const auto got = as_board<palpate_ModelState_1_0>(frame.bytes, header);
    EXPECT_EQ(header.transfer_id, id % 32);
    EXPECT_EQ(header.source, wire::kHostNode);
    EXPECT_TRUE(std::equal(std::begin(state.p.elements), std::end(state.p.elements), got.p.elements));
  }
  const OutgoingFrame command = host.encode(
      palpate_Command_Request_1_0{.action = palpate_Command_Request_1_0_ARM_CONFIRM, ._token = 9});
  EXPECT_EQ(as_board<palpate_Command_Request_1_0>(command.bytes, header)._token, 9u);
  EXPECT_EQ(header.destination, wire::kBoardNode);
}

// Losses are counted across the wrap of the identifier's 5 bits.
TEST_P(CanHost, MessagesFromTheBoardAndLosses) {
  HostEndpoint host({.framing = GetParam()});
  std::size_t received = 0, sent = 0;
  for (std::uint32_t id = 0; id < 199; ++id) {
    if (id % 7 == 3) continue;
    ++sent;
    for (const Incoming& message : host.receive(from_board(trace(id), id), id)) {
      ++received;
      EXPECT_EQ(std::get<palpate_ServoTrace_1_0>(message).sequence, id);
    }
  }
  EXPECT_EQ(received, sent);
  EXPECT_EQ(host.counters().frames_lost, 199 - sent);
  EXPECT_EQ(host.counters().frames_refused, 0u);
}

// A response carries 5 bits of its request's identifier; the host knows the rest.
TEST_P(CanHost, ResponsesAreTakenForTheNewestRequest) {
  HostEndpoint host({.first_transfer_id = 1000, .framing = GetParam()});
  const palpate_Command_Request_1_0 command{.action = palpate_Command_Request_1_0_DISARM, ._token = 0};
  for (std::uint64_t id = 1000; id < 1100; ++id) {
    const OutgoingFrame request = host.encode(command);
    ASSERT_EQ(request.transfer_id, id);
    if (id % 5 != 0) continue;  // the others' responses are lost
    const auto messages =
        host.receive(from_board(palpate_Command_Response_1_0{.status = 3, .mode = 0, ._token = 0}, id), 0);
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(std::get<CommandResponse>(messages[0]).transfer_id, id);
  }
  // A late one, of a request before the newest.
  host.encode(command);
  host.encode(command);
  const auto late =
      host.receive(from_board(palpate_Command_Response_1_0{.status = 3, .mode = 0, ._token = 0}, 1100), 0);
  ASSERT_EQ(late.size(), 1u);
  EXPECT_EQ(std::get<CommandResponse>(late[0]).transfer_id, 1100u);
  // To a request that never was: as it came.
  const auto info = host.receive(from_board(palpate_GetInfo_Response_1_0{}, 77), 0);
  ASSERT_EQ(info.size(), 1u);
  EXPECT_EQ(std::get<InfoResponse>(info[0]).transfer_id, 77u % 32);
}

TEST_P(CanHost, NodesThatCanCannotNameAreRefused) {
  EXPECT_THROW(HostEndpoint({.node = 128, .framing = GetParam()}), std::invalid_argument);
  EXPECT_THROW(HostEndpoint({.board = 128, .framing = GetParam()}), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(HostEndpoint, CanHost,
                         testing::Values(FramingKind::can_classic, FramingKind::can_fd));

}  // namespace
}  // namespace palpate::link
