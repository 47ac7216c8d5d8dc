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

std::unique_ptr<palpate_LocalModel_1_0> model(std::size_t modes, std::size_t nodes, std::size_t triangles) {
  std::mt19937 random(static_cast<unsigned>(modes + nodes));
  auto message = std::make_unique<palpate_LocalModel_1_0>();
  message->sequence = 7;
  message->schema_hash = kSchemaHash;
  message->tick = 123456;
  message->valid_ticks = 500;
  message->modes = static_cast<std::uint16_t>(modes);
  message->nodes = static_cast<std::uint8_t>(nodes);
  message->triangles = static_cast<std::uint8_t>(triangles);
  for (float& value : message->origin_m) value = number(random);
  message->tip_radius_m = 1e-3f;
  message->surface = palpate_LocalModel_1_0_SURFACE_FLAT;
  message->coupling_stiffness_N_m = 2000.0f;
  message->coupling_damping_N_s_m = 1.5f;
  message->tip_source = palpate_LocalModel_1_0_TIP_ESTIMATED;
  message->contact.mode = palpate_Contact_1_0_MODE_SLIP;
  message->contact.triangle = 4321;
  for (float& value : message->contact.barycentric) value = number(random);
  for (float& value : message->contact.force_N) value = number(random);
  for (float& value : message->contact.coupling_stretch_m) value = number(random);
  fill(message->position_m, 3 * nodes, random);
  fill(message->triangle_id, triangles, random);
  fill(message->corner, 3 * triangles, random);
  fill(message->triangle_friction, triangles, random);
  const std::size_t frictions = triangles > 0 ? kMaxFrictions : 0;
  fill(message->static_friction, frictions, random);
  fill(message->kinetic_friction, frictions, random);
  fill(message->coefficient, 6 * modes, random);
  fill(message->load, modes, random);
  fill(message->state_q, modes, random);
  fill(message->state_p, modes, random);
  fill(message->basis_scale, modes, random);
  fill(message->basis, 3 * nodes * modes, random);
  return message;
}

TEST(Messages, LocalModelRoundTrip) {
  expect_round_trip(*model(0, 0, 0));
  expect_round_trip(*model(1, 1, 1));
  expect_round_trip(*model(48, 16, 18), 7);
  expect_round_trip(*model(kMaxModes, 16, kMaxTriangles), 97);
  expect_round_trip(*model(96, kMaxSurfaceNodes, kMaxTriangles), 97);
}

TEST(Messages, LargestLocalModelFillsThePayload) {
  const auto largest = model(kMaxModes, 16, kMaxTriangles);
  std::mt19937 random(1);
  fill(largest->position_m, 3 * kMaxSurfaceNodes, random);
  EXPECT_EQ(to_bytes(*largest).size(), kLargestPayloadToBoard);
  expect_round_trip(*largest, 997);
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

TEST(Messages, SmallMessagesRoundTrip) {
  palpate_BoardStatus_1_0 status{};
  status.sequence = 1;
  status.schema_hash = kSchemaHash;
  status.mode = palpate_BoardStatus_1_0_MODE_RENDER;
  status.faults = 0x8001;
  status._token = 0xDEADBEEF;
  status.clock_Hz = 170'000'000;
  expect_round_trip(status);
  expect_round_trip(palpate_ModelReport_1_0{.sequence = 5, .status = 34, .model_tick = 100, .swap_tick = 0});
  expect_round_trip(palpate_TraceRequest_1_0{.first_tick = 77, .count = 256});
  expect_round_trip(
      palpate_Command_Request_1_0{.action = palpate_Command_Request_1_0_ARM_CONFIRM, ._token = 0x12345678});
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
  const auto large = model(kMaxModes, 16, kMaxTriangles);
  large->basis.count = kMaxBasis + 1;
  Bytes out(kLargestPayloadToBoard);
  std::size_t written = 0;
  EXPECT_EQ(serialize(*large, out, written), Status::payload_malformed);

  // On the way in: each length prefix of an empty model raised beyond its bound. They follow the fixed
  // fields.
  const Bytes empty = to_bytes(*model(0, 0, 0));
  struct Prefix {
    std::size_t at, bytes, bound;
  };
  constexpr std::size_t kFixedBytes = 109;
  for (const Prefix& prefix :
       {Prefix{0, 1, 96}, Prefix{1, 1, 96}, Prefix{2, 2, 288}, Prefix{4, 1, 96}, Prefix{5, 1, 4},
        Prefix{6, 1, 4}, Prefix{7, 2, 1152}, Prefix{9, 1, 192}, Prefix{10, 1, 192}, Prefix{11, 1, 192},
        Prefix{12, 1, 192}, Prefix{13, 2, 9216}}) {
    Bytes bytes = empty;
    ASSERT_EQ(bytes.size(), kFixedBytes + 15);
    bytes.resize(kLargestPayloadToBoard + 100);
    bytes[kFixedBytes + prefix.at] = static_cast<std::uint8_t>((prefix.bound + 1) & 0xFF);
    if (prefix.bytes == 2)
      bytes[kFixedBytes + prefix.at + 1] = static_cast<std::uint8_t>((prefix.bound + 1) >> 8);
    palpate_LocalModel_1_0& message = *large;
    EXPECT_EQ(deserialize(bytes, message), Status::payload_malformed) << prefix.at;
  }
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
  const auto message = std::make_unique<palpate_LocalModel_1_0>();
  palpate_ServoTrace_1_0 trace{};
  palpate_GetInfo_Response_1_0 info{};
  std::size_t decoded = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    Bytes bytes(random() % 400);
    for (std::uint8_t& byte : bytes)
      byte = static_cast<std::uint8_t>(random() % 4 == 0 ? random() & 0xFF : 0);
    if (deserialize(bytes, *message) == Status::ok) {
      ++decoded;
      ASSERT_LE(message->basis.count, kMaxBasis);
      ASSERT_LE(payload_bytes(*message), bytes.size());
    }
    if (deserialize(bytes, trace) == Status::ok) {
      ASSERT_LE(trace.samples.count, std::size_t{palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_});
    }
    if (deserialize(bytes, info) == Status::ok) {
      ASSERT_LE(info.board.count, std::size_t{palpate_GetInfo_Response_1_0_board_ARRAY_CAPACITY_});
    }
  }
  EXPECT_GT(decoded, 0u);
}

}  // namespace
}  // namespace palpate::wire
