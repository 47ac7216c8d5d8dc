#include "shared/wire/messages.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Message>
Bytes to_bytes(const Message& message) {
  Bytes out(MessageTraits<Message>::kMaxBytes);
  std::size_t written = 0;
  EXPECT_EQ(serialize(message, out, written), Status::ok);
  EXPECT_EQ(written, payload_bytes(message));
  out.resize(written);
  return out;
}

// Bytes to message to bytes: what was read is all that was written. Also refused at every shorter length, and
// not disturbed by bytes that a later version may append.
template <class Message>
void expect_round_trip(const Message& message, std::size_t length_step = 1) {
  Bytes bytes = to_bytes(message);
  const auto back = std::make_unique<Message>();
  ASSERT_EQ(deserialize(bytes, *back), Status::ok);
  EXPECT_EQ(to_bytes(*back), bytes);
  for (std::size_t length = 0; length < bytes.size(); length += length_step)
    ASSERT_EQ(deserialize(std::span(bytes).first(length), *back), Status::payload_malformed) << length;
  const Bytes plain = bytes;
  bytes.resize(bytes.size() + 5, 0xEE);
  ASSERT_EQ(deserialize(bytes, *back), Status::ok);
  EXPECT_EQ(to_bytes(*back), plain);
}

float number(std::mt19937& random) {
  return static_cast<float>(random()) * 1e-9f - 2.0f;
}

template <class Array>
void fill(Array& array, std::size_t count, std::mt19937& random) {
  array.count = count;
  for (std::size_t i = 0; i < count; ++i) {
    using Element = std::remove_reference_t<decltype(array.elements[0])>;
    if constexpr (std::is_floating_point_v<Element>) {
      array.elements[i] = number(random);
    } else {
      array.elements[i] = static_cast<Element>(random());
    }
  }
}

palpate_ModelState_1_0 model_state(std::size_t modes, std::size_t nodes) {
  std::mt19937 random(static_cast<unsigned>(modes + nodes));
  palpate_ModelState_1_0 message{};
  message.sequence = 7;
  message.schema_hash = kSchemaHash;
  message.tick = 123456;
  message.basis_id = 0xCAFEBABE;
  message.valid_ticks = 500;
  message.growth_ticks = 97;
  message.tip_source = palpate_ModelState_1_0_TIP_ESTIMATED;
  message.contact.mode = palpate_Contact_1_0_MODE_SLIP;
  message.contact.triangle = 4321;
  for (float& value : message.contact.barycentric) value = number(random);
  for (float& value : message.contact.force_N) value = number(random);
  for (float& value : message.contact.coupling_stretch_m) value = number(random);
  message.displacement_step_m = number(random);
  message.load_step_m = number(random);
  message.q_step_m = number(random);
  message.p_step_m_s = number(random);
  fill(message.displacement, 3 * nodes, random);
  fill(message.load, modes, random);
  fill(message.q, modes, random);
  fill(message.p, modes, random);
  return message;
}

palpate_ModelPart_1_0 model_part(std::size_t bytes) {
  std::mt19937 random(static_cast<unsigned>(bytes));
  palpate_ModelPart_1_0 message{.basis_id = 0xCAFEBABE, .basis_bytes = 13'000, .first_block = 44, .data = {}};
  fill(message.data, bytes, random);
  return message;
}

TEST(Messages, ModelStateRoundTrip) {
  expect_round_trip(model_state(0, 0));
  expect_round_trip(model_state(1, 1));
  expect_round_trip(model_state(48, 16), 7);
  expect_round_trip(model_state(kMaxModes, kMaxSurfaceNodes), 97);
  EXPECT_EQ(to_bytes(model_state(kMaxModes, kMaxSurfaceNodes)).size(), kLargestPayloadToBoard);
}

// Without modal positions, as the host sends it: what classic CAN at 1 Mbit/s is reckoned with.
TEST(Messages, AStateOf48ModesAnd32NodesIsSmall) {
  palpate_ModelState_1_0 state = model_state(48, 32);
  state.q.count = 0;
  EXPECT_LE(to_bytes(state).size(), 520u);
}

TEST(Messages, ModelPartRoundTrip) {
  for (const std::size_t bytes : {0u, 1u, 256u, 1000u, 1024u}) expect_round_trip(model_part(bytes), 97);
}

TEST(Messages, BasisReportRoundTrip) {
  std::mt19937 random(1);
  for (const std::size_t count : {0u, 3u}) {
    palpate_BasisReport_1_0 report{
        .basis_id = 77, .status = 38, .basis_bytes = 13'000, .missing = {}, .held = {}};
    fill(report.missing, 5 * count, random);
    fill(report.held, count, random);
    expect_round_trip(report);
  }
}

TEST(Messages, ServoTraceRoundTrip) {
  std::mt19937 random(1);
  for (const std::size_t samples : {0u, 1u, 10u, 32u}) {
    palpate_ServoTrace_1_0 trace{};
    trace.sequence = 9;
    trace.first_tick = 0xFFFFFFF0u;
    trace.samples.count = samples;
    for (std::size_t i = 0; i < samples; ++i) {
      palpate_ServoSample_1_0& sample = trace.samples.elements[i];
      for (float& value : sample.tip_m) value = number(random);
      for (float& value : sample.force_N) value = number(random);
      sample.mode = palpate_Contact_1_0_MODE_STICK;
      sample.flags = palpate_ServoSample_1_0_FLAG_RENDERING;
      sample.triangle = static_cast<std::uint16_t>(random());
    }
    expect_round_trip(trace);
  }
}

TEST(Messages, TipTraceRoundTrip) {
  std::mt19937 random(1);
  for (const std::size_t offsets : {0u, 3u, 7u, 31u}) {
    palpate_TipTrace_1_0 trace{};
    trace.first_tick = 0xFFFFFFF0u;
    for (float& value : trace.tip_m) value = number(random);
    trace.step_exponent = -20;
    trace.offsets.count = offsets;
    for (std::size_t i = 0; i < offsets; ++i)
      for (std::int16_t& step : trace.offsets.elements[i].steps) step = static_cast<std::int16_t>(random());
    expect_round_trip(trace);
    EXPECT_EQ(to_bytes(trace).size(), 18 + 6 * offsets);
  }
}

TEST(Messages, SmallMessagesRoundTrip) {
  palpate_BoardStatus_1_0 status{};
  status.sequence = 1;
  status.schema_hash = kSchemaHash;
  status.mode = palpate_BoardStatus_1_0_MODE_RENDER;
  status.faults = 0x8001;
  status._token = 0xDEADBEEF;
  status.clock_Hz = 170'000'000;
  expect_round_trip(status);
  expect_round_trip(palpate_ModelReport_1_0{
      .sequence = 5, .status = 0, .model_tick = 100, .swap_tick = 130, .correction_energy_J = -2.5e-3f});
  expect_round_trip(palpate_TraceRequest_1_0{.first_tick = 77, .count = 256, .form = 1, .ticks = 8});
  expect_round_trip(
      palpate_Command_Request_1_0{.action = palpate_Command_Request_1_0_ARM_CONFIRM, ._token = 0x12345678});
  expect_round_trip(palpate_DirectForce_1_0{.force_N = {1.0f, -2.0f, 0.5f}});
  expect_round_trip(palpate_DeviceState_1_0{.tick = 7,
                                            .tip_m = {1.0f, -2.0f, 0.5f},
                                            .velocity_m_s = {0.1f, 0.2f, 0.3f},
                                            .force_N = {3.0f, 2.0f, 1.0f},
                                            .mode = 5,
                                            .flags = 16,
                                            .faults = 0x8001});
  expect_round_trip(palpate_Command_Response_1_0{.status = 49, .mode = 1, ._token = 0});
  palpate_GetInfo_Response_1_0 info{};
  info.schema_hash = kSchemaHash;
  std::memcpy(info.board.elements, "mps2_an386", 10);
  info.board.count = 10;
  info.firmware.count = 32;
  info.tick_rate_Hz = 1000;
  expect_round_trip(info);
  Bytes none;
  std::size_t written = 1;
  EXPECT_EQ(serialize(palpate_GetInfo_Request_1_0{}, none, written), Status::ok);
  EXPECT_EQ(written, 0u);
  palpate_GetInfo_Request_1_0 request{};
  EXPECT_EQ(deserialize(none, request), Status::ok);
}

TEST(Messages, CountBeyondItsBoundIsRefused) {
  palpate_ModelState_1_0 large = model_state(kMaxModes, kMaxSurfaceNodes);
  large.load.count = kMaxModes + 1;
  Bytes out(kLargestPayloadToBoard);
  std::size_t written = 0;
  EXPECT_EQ(serialize(large, out, written), Status::payload_malformed);

  // On the way in: each length prefix of an empty state raised beyond its bound. They follow the fixed
  // fields.
  const Bytes empty = to_bytes(model_state(0, 0));
  struct Prefix {
    std::size_t at, bound;
  };
  constexpr std::size_t kFixedBytes = 102;
  for (const Prefix& prefix : {Prefix{0, 96}, Prefix{1, 192}, Prefix{2, 192}, Prefix{3, 192}}) {
    Bytes bytes = empty;
    ASSERT_EQ(bytes.size(), kFixedBytes + 4);
    bytes.resize(kLargestPayloadToBoard + 100);
    bytes[kFixedBytes + prefix.at] = static_cast<std::uint8_t>(prefix.bound + 1);
    EXPECT_EQ(deserialize(bytes, large), Status::payload_malformed) << prefix.at;
  }
  Bytes tips = to_bytes(palpate_TipTrace_1_0{});
  tips.resize(1000);
  tips[17] = 32;
  palpate_TipTrace_1_0 tip_trace;
  EXPECT_EQ(deserialize(tips, tip_trace), Status::payload_malformed);
  Bytes part = to_bytes(model_part(0));
  constexpr std::size_t kFixedPartBytes = 10;
  ASSERT_EQ(part.size(), kFixedPartBytes + 2);
  part.resize(2000);
  part[kFixedPartBytes] = 0x01;
  part[kFixedPartBytes + 1] = 0x04;  // 1,025 bytes
  palpate_ModelPart_1_0 message;
  EXPECT_EQ(deserialize(part, message), Status::payload_malformed);
}

TEST(Messages, BufferShorterThanTheMessagesMaximumIsRefused) {
  Bytes out(MessageTraits<palpate_ServoTrace_1_0>::kMaxBytes - 1);
  std::size_t written = 0;
  EXPECT_EQ(serialize(palpate_ServoTrace_1_0{}, out, written), Status::payload_malformed);
}

// Any bytes at all either decode within bounds or are refused; under AddressSanitizer nothing else is
// touched.
TEST(Messages, RandomPayloadsStayWithinBounds) {
  std::mt19937 random(3);
  palpate_ModelState_1_0 state{};
  palpate_ModelPart_1_0 part{};
  palpate_ServoTrace_1_0 trace{};
  palpate_TipTrace_1_0 tip_trace{};
  palpate_GetInfo_Response_1_0 info{};
  std::size_t decoded = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    Bytes bytes(random() % 400);
    for (std::uint8_t& byte : bytes)
      byte = static_cast<std::uint8_t>(random() % 4 == 0 ? random() & 0xFF : 0);
    if (deserialize(bytes, state) == Status::ok) {
      ++decoded;
      ASSERT_LE(state.displacement.count, 3 * kMaxSurfaceNodes);
      ASSERT_LE(payload_bytes(state), bytes.size());
    }
    if (deserialize(bytes, part) == Status::ok) {
      ASSERT_LE(payload_bytes(part), bytes.size());
    }
    if (deserialize(bytes, trace) == Status::ok) {
      ASSERT_LE(trace.samples.count, std::size_t{palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_});
    }
    if (deserialize(bytes, tip_trace) == Status::ok) {
      ASSERT_LE(tip_trace.offsets.count, std::size_t{palpate_TipTrace_1_0_offsets_ARRAY_CAPACITY_});
    }
    if (deserialize(bytes, info) == Status::ok) {
      ASSERT_LE(info.board.count, std::size_t{palpate_GetInfo_Response_1_0_board_ARRAY_CAPACITY_});
    }
  }
  EXPECT_GT(decoded, 0u);
}

}  // namespace
}  // namespace palpate::wire
