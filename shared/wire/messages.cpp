#include "shared/wire/messages.hpp"

#include "shared/contact/contact_state.hpp"

namespace palpate::wire {
namespace {

// nunavut names its functions by type; this gives them one name to be called by from templates.
template <class Message>
struct Generated;

#define PALPATE_GENERATED(type)                                          \
  template <>                                                            \
  struct Generated<palpate_##type> {                                     \
    static constexpr auto kSerialize = &palpate_##type##_serialize_;     \
    static constexpr auto kDeserialize = &palpate_##type##_deserialize_; \
  }
PALPATE_GENERATED(ServoTrace_1_0);
PALPATE_GENERATED(TipTrace_1_0);
PALPATE_GENERATED(BoardStatus_1_0);
PALPATE_GENERATED(ModelReport_1_0);
PALPATE_GENERATED(BasisReport_1_0);
PALPATE_GENERATED(ModelPart_1_0);
PALPATE_GENERATED(ModelState_1_0);
PALPATE_GENERATED(TraceRequest_1_0);
PALPATE_GENERATED(DirectForce_1_0);
PALPATE_GENERATED(DeviceState_1_0);
PALPATE_GENERATED(Command_Request_1_0);
PALPATE_GENERATED(Command_Response_1_0);
PALPATE_GENERATED(GetInfo_Request_1_0);
PALPATE_GENERATED(GetInfo_Response_1_0);
#undef PALPATE_GENERATED

constexpr std::size_t kServoSampleBytes = palpate_ServoSample_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_;
constexpr std::size_t kTipOffsetBytes = palpate_TipOffset_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_;

// Constants that stand both in DSDL and in C++.
static_assert(palpate_Contact_1_0_MODE_FREE == static_cast<std::uint8_t>(ContactMode::free));
static_assert(palpate_Contact_1_0_MODE_STICK == static_cast<std::uint8_t>(ContactMode::stick));
static_assert(palpate_Contact_1_0_MODE_SLIP == static_cast<std::uint8_t>(ContactMode::slip));
static_assert(palpate_ModelState_1_0_KIND_MODES == static_cast<std::uint8_t>(ModelKind::modes));
static_assert(palpate_ModelState_1_0_KIND_HELD_FORCE == static_cast<std::uint8_t>(ModelKind::held_force));
static_assert(palpate_ModelState_1_0_KIND_MODES_FROM_NOW ==
              static_cast<std::uint8_t>(ModelKind::modes_from_now));
static_assert(palpate_ModelState_1_0_TIP_COUNTS == static_cast<std::uint8_t>(TipSource::counts));
static_assert(palpate_ModelState_1_0_TIP_ESTIMATED == static_cast<std::uint8_t>(TipSource::estimated));

}  // namespace

// The longest payload less the array entries that are not there.
std::size_t payload_bytes(const palpate_ModelState_1_0& message) {
  return MessageTraits<palpate_ModelState_1_0>::kMaxBytes -
         2 * (palpate_ModelState_1_0_displacement_ARRAY_CAPACITY_ - message.displacement.count) -
         2 * (palpate_ModelState_1_0_load_ARRAY_CAPACITY_ - message.load.count) -
         2 * (palpate_ModelState_1_0_q_ARRAY_CAPACITY_ - message.q.count) -
         2 * (palpate_ModelState_1_0_p_ARRAY_CAPACITY_ - message.p.count);
}

std::size_t payload_bytes(const palpate_ModelPart_1_0& message) {
  return MessageTraits<palpate_ModelPart_1_0>::kMaxBytes -
         (palpate_ModelPart_1_0_data_ARRAY_CAPACITY_ - message.data.count);
}

std::size_t payload_bytes(const palpate_BasisReport_1_0& message) {
  return MessageTraits<palpate_BasisReport_1_0>::kMaxBytes -
         (palpate_BasisReport_1_0_missing_ARRAY_CAPACITY_ - message.missing.count) -
         4 * (palpate_BasisReport_1_0_held_ARRAY_CAPACITY_ - message.held.count);
}

std::size_t payload_bytes(const palpate_ServoTrace_1_0& message) {
  return MessageTraits<palpate_ServoTrace_1_0>::kMaxBytes -
         kServoSampleBytes * (palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_ - message.samples.count);
}

std::size_t payload_bytes(const palpate_TipTrace_1_0& message) {
  return MessageTraits<palpate_TipTrace_1_0>::kMaxBytes -
         kTipOffsetBytes * (palpate_TipTrace_1_0_offsets_ARRAY_CAPACITY_ - message.offsets.count);
}

std::size_t payload_bytes(const palpate_GetInfo_Response_1_0& message) {
  return MessageTraits<palpate_GetInfo_Response_1_0>::kMaxBytes -
         (palpate_GetInfo_Response_1_0_board_ARRAY_CAPACITY_ - message.board.count) -
         (palpate_GetInfo_Response_1_0_firmware_ARRAY_CAPACITY_ - message.firmware.count);
}

template <class Message>
Status serialize(const Message& message, std::span<std::uint8_t> out, std::size_t& written) {
  std::size_t bytes = out.size();
  std::uint8_t nothing = 0;  // the generated code takes no null pointer, not even for no bytes
  std::uint8_t* const to = out.empty() ? &nothing : out.data();
  if (Generated<Message>::kSerialize(&message, to, &bytes) < 0) return Status::payload_malformed;
  written = bytes;
  return Status::ok;
}

template <class Message>
Status deserialize(std::span<const std::uint8_t> payload, Message& message) {
  std::size_t bytes = payload.size();
  if (Generated<Message>::kDeserialize(&message, payload.data(), &bytes) < 0)
    return Status::payload_malformed;
  return payload.size() < payload_bytes(message) ? Status::payload_malformed : Status::ok;
}

#define PALPATE_INSTANTIATE(type)                                                                          \
  template Status serialize<palpate_##type>(const palpate_##type&, std::span<std::uint8_t>, std::size_t&); \
  template Status deserialize<palpate_##type>(std::span<const std::uint8_t>, palpate_##type&)
PALPATE_INSTANTIATE(ServoTrace_1_0);
PALPATE_INSTANTIATE(TipTrace_1_0);
PALPATE_INSTANTIATE(BoardStatus_1_0);
PALPATE_INSTANTIATE(ModelReport_1_0);
PALPATE_INSTANTIATE(BasisReport_1_0);
PALPATE_INSTANTIATE(ModelPart_1_0);
PALPATE_INSTANTIATE(ModelState_1_0);
PALPATE_INSTANTIATE(TraceRequest_1_0);
PALPATE_INSTANTIATE(DirectForce_1_0);
PALPATE_INSTANTIATE(DeviceState_1_0);
PALPATE_INSTANTIATE(Command_Request_1_0);
PALPATE_INSTANTIATE(Command_Response_1_0);
PALPATE_INSTANTIATE(GetInfo_Request_1_0);
PALPATE_INSTANTIATE(GetInfo_Response_1_0);
#undef PALPATE_INSTANTIATE

}  // namespace palpate::wire
