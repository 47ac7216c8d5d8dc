// Any payload is a message or is refused; what is one comes back from its own bytes.
#include <algorithm>
#include <memory>
#include <tuple>
#include <vector>

#include "host/fuzz/input.hpp"
#include "shared/wire/messages.hpp"

using namespace palpate;
using fuzz::require;

namespace {

template <class Message>
void decode(std::span<const std::uint8_t> payload) {
  constexpr std::size_t kMaxBytes = wire::MessageTraits<Message>::kMaxBytes;
  // On the heap, and as long as it is: reading beyond it is noticed.
  const std::vector<std::uint8_t> exact(payload.begin(), payload.end());
  const auto message = std::make_unique<Message>();
  if (wire::deserialize<Message>(exact, *message) != Status::ok) return;
  require(wire::payload_bytes(*message) <= std::min(payload.size(), kMaxBytes),
          "a message is no longer than its payload");
  std::vector<std::uint8_t> first(kMaxBytes), second(kMaxBytes);
  std::size_t first_bytes = 0, second_bytes = 0;
  require(wire::serialize(*message, first, first_bytes) == Status::ok, "what was read can be written");
  require(first_bytes == wire::payload_bytes(*message), "payload_bytes() is the length");
  first.resize(first_bytes);
  const auto again = std::make_unique<Message>();
  require(wire::deserialize<Message>(first, *again) == Status::ok, "what was written can be read");
  require(wire::serialize(*again, second, second_bytes) == Status::ok, "and written again");
  second.resize(second_bytes);
  require(first == second, "a message comes back from its bytes");
}

using Messages =
    std::tuple<palpate_ServoTrace_1_0, palpate_TipTrace_1_0, palpate_BoardStatus_1_0, palpate_ModelReport_1_0,
               palpate_BasisReport_1_0, palpate_ModelState_1_0, palpate_ModelPart_1_0,
               palpate_DirectForce_1_0, palpate_DeviceState_1_0, palpate_TraceRequest_1_0,
               palpate_Command_Request_1_0, palpate_Command_Response_1_0, palpate_GetInfo_Request_1_0,
               palpate_GetInfo_Response_1_0>;

template <std::size_t... I>
void decode_as(std::size_t which, std::span<const std::uint8_t> payload, std::index_sequence<I...>) {
  ((which == I ? decode<std::tuple_element_t<I, Messages>>(payload) : void()), ...);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  constexpr std::size_t kMessages = std::tuple_size_v<Messages>;
  const std::size_t which = input.take<std::uint8_t>() % kMessages;
  decode_as(which, input.bytes(size), std::make_index_sequence<kMessages>());
  return 0;
}
