// Local models as a fuzzer wants them: a valid one of the firmware's tests, with some of its bytes changed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "firmware/test_support.hpp"
#include "host/fuzz/input.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::fuzz {

// Payloads of the messages that carry it.
struct ModelPayloads {
  std::vector<std::uint8_t> basis;
  std::vector<std::vector<std::uint8_t>> parts;
  std::vector<std::uint8_t> state;
};

template <class Message>
std::vector<std::uint8_t> payload_of(const Message& message) {
  std::vector<std::uint8_t> bytes(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  require(wire::serialize(message, bytes, length) == Status::ok, "a message can be written");
  bytes.resize(length);
  return bytes;
}

// Changes some bytes, or puts a number there that is seldom a good one.
inline void change(Input& input, std::span<std::uint8_t> bytes) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr std::array kOddNumbers{
      std::numeric_limits<float>::quiet_NaN(),  kInfinity, -kInfinity, 0.0f, -1.0f, 1e30f, -1e30f, 1e-30f,
      std::numeric_limits<float>::denorm_min(), 100.0f};
  const std::size_t changes = input.take<std::uint8_t>() % 8;
  for (std::size_t i = 0; i < changes && bytes.size() >= 4; ++i) {
    const auto how = input.take<std::uint8_t>();
    const std::size_t at = input.take<std::uint16_t>() % (bytes.size() - 3);
    if (how % 2 == 0) {
      bytes[at] = input.take<std::uint8_t>();
    } else {
      const float number = kOddNumbers[how / 2 % kOddNumbers.size()];
      std::memcpy(&bytes[at], &number, sizeof number);
    }
  }
}

// Springs between all nodes, of two kinds.
inline void add_springs(wire::ModelContents& contents) {
  contents.rest_m = contents.position_m;
  for (std::uint8_t j = 1; j < contents.nodes; ++j) {
    for (std::uint8_t i = 0; i < j; ++i) {
      contents.spring_end.elements[contents.spring_end.count++] = i;
      contents.spring_end.elements[contents.spring_end.count++] = j;
      contents.spring_kind.elements[contents.spring_kind.count++] = (j - i) % 2 == 0;
    }
  }
  const auto fill = [](auto& field, float first, float second) {
    field.count = 2;
    field.elements[0] = first;
    field.elements[1] = second;
  };
  fill(contents.spring_stiffness_N_m, 100.0f, 70.0f);
  fill(contents.spring_damping_N_s_m, 0.4f, 0.3f);
  fill(contents.spring_length_m, 0.01f, 0.014f);
}

// A square near the tip's reference pose, as the host had it some ticks before `now_tick`.
inline ModelPayloads take_model(Input& input, std::uint32_t now_tick) {
  const auto form = input.take<std::uint8_t>();
  const auto sequence = input.take<std::uint8_t>();
  const std::uint32_t tick = now_tick - input.take<std::uint8_t>();
  const float height_m = -1e-4f * static_cast<float>(input.take<std::int8_t>());
  wire::ModelContents contents = firmware::test::square_model(sequence, tick, {0.0f, 0.0f, height_m});
  if ((form & 1U) != 0) add_springs(contents);
  if ((form & 2U) != 0) contents.tip_radius_m = 2e-3f;
  if ((form & 4U) != 0) contents.coupling_stiffness_N_m = 500.0f;
  if ((form & 8U) != 0) contents.kind = static_cast<std::uint8_t>(ModelKind::modes_from_now);
  if ((form & 16U) != 0) contents.surface = static_cast<std::uint8_t>(SurfaceKind::flat);
  if ((form & 32U) != 0) contents.tip_source = palpate_ModelState_1_0_TIP_ESTIMATED;

  const wire::PackedModel packed = wire::pack(contents);
  ModelPayloads payloads{*packed.basis, {}, {}};
  change(input, payloads.basis);
  palpate_ModelState_1_0 state = packed.state;
  state.basis_id = wire::basis_id(payloads.basis);
  for (const palpate_ModelPart_1_0& part : wire::parts_of(payloads.basis, state.basis_id)) {
    payloads.parts.push_back(payload_of(part));
    if ((form & 64U) != 0) change(input, payloads.parts.back());
  }
  payloads.state = payload_of(state);
  change(input, payloads.state);
  return payloads;
}

}  // namespace palpate::fuzz
