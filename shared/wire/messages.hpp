// The messages of shared/wire/dsdl as C structs (compiled by nunavut) and as bytes of a frame's payload.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "palpate/BasisReport_1_0.h"
#include "palpate/BoardStatus_1_0.h"
#include "palpate/Command_1_0.h"
#include "palpate/DeviceState_1_0.h"
#include "palpate/DirectForce_1_0.h"
#include "palpate/GetInfo_1_0.h"
#include "palpate/ModelPart_1_0.h"
#include "palpate/ModelReport_1_0.h"
#include "palpate/ModelState_1_0.h"
#include "palpate/ServoTrace_1_0.h"
#include "palpate/TipTrace_1_0.h"
#include "palpate/TraceRequest_1_0.h"
#include "palpate/schema_hash.hpp"  // kSchemaHash
#include "shared/model/local_model.hpp"
#include "shared/status.hpp"
#include "shared/wire/model_basis.hpp"
#include "shared/wire/ports.hpp"

namespace palpate::wire {

// What the wire knows about a message type: kSpecifier of the frames that carry it, kMaxBytes of its payload.
template <class Message>
struct MessageTraits;

template <std::uint16_t Specifier, std::size_t MaxBytes>
struct BasicMessageTraits {
  static constexpr std::uint16_t kSpecifier = Specifier;
  static constexpr std::size_t kMaxBytes = MaxBytes;
};
template <>
struct MessageTraits<palpate_ServoTrace_1_0>
    : BasicMessageTraits<message_specifier(kServoTraceSubject),
                         palpate_ServoTrace_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_TipTrace_1_0>
    : BasicMessageTraits<message_specifier(kTipTraceSubject),
                         palpate_TipTrace_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_BoardStatus_1_0>
    : BasicMessageTraits<message_specifier(kBoardStatusSubject),
                         palpate_BoardStatus_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_ModelReport_1_0>
    : BasicMessageTraits<message_specifier(kModelReportSubject),
                         palpate_ModelReport_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_BasisReport_1_0>
    : BasicMessageTraits<message_specifier(kBasisReportSubject),
                         palpate_BasisReport_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_ModelState_1_0>
    : BasicMessageTraits<message_specifier(kModelStateSubject),
                         palpate_ModelState_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_ModelPart_1_0>
    : BasicMessageTraits<message_specifier(kModelPartSubject),
                         palpate_ModelPart_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_TraceRequest_1_0>
    : BasicMessageTraits<message_specifier(kTraceRequestSubject),
                         palpate_TraceRequest_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_DirectForce_1_0>
    : BasicMessageTraits<message_specifier(kDirectForceSubject),
                         palpate_DirectForce_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_DeviceState_1_0>
    : BasicMessageTraits<message_specifier(kDeviceStateSubject),
                         palpate_DeviceState_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_Command_Request_1_0>
    : BasicMessageTraits<request_specifier(kCommandService),
                         palpate_Command_Request_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_Command_Response_1_0>
    : BasicMessageTraits<response_specifier(kCommandService),
                         palpate_Command_Response_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_GetInfo_Request_1_0>
    : BasicMessageTraits<request_specifier(kGetInfoService),
                         palpate_GetInfo_Request_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};
template <>
struct MessageTraits<palpate_GetInfo_Response_1_0>
    : BasicMessageTraits<response_specifier(kGetInfoService),
                         palpate_GetInfo_Response_1_0_SERIALIZATION_BUFFER_SIZE_BYTES_> {};

// Largest payloads that each side receives: the capacities of their receivers.
inline constexpr std::size_t kLargestPayloadToBoard = MessageTraits<palpate_ModelState_1_0>::kMaxBytes;
static_assert(kLargestPayloadToBoard >= MessageTraits<palpate_ModelPart_1_0>::kMaxBytes);
inline constexpr std::size_t kLargestPayloadToHost = MessageTraits<palpate_ServoTrace_1_0>::kMaxBytes;

// Length of the message's payload, from its array counts (which must be within bounds). Any context.
std::size_t payload_bytes(const palpate_ModelState_1_0& message);
std::size_t payload_bytes(const palpate_ModelPart_1_0& message);
std::size_t payload_bytes(const palpate_BasisReport_1_0& message);
std::size_t payload_bytes(const palpate_ServoTrace_1_0& message);
std::size_t payload_bytes(const palpate_TipTrace_1_0& message);
std::size_t payload_bytes(const palpate_GetInfo_Response_1_0& message);
template <class Message>
constexpr std::size_t payload_bytes(const Message&) {
  return MessageTraits<Message>::kMaxBytes;  // the others are of fixed length
}

// Message to payload. `out` must hold kMaxBytes of the message, whatever its array counts are. Returns
// Status::payload_malformed when `out` is smaller or an array count is beyond its bound; `written` is set
// with Status::ok.
template <class Message>
Status serialize(const Message& message, std::span<std::uint8_t> out, std::size_t& written);

// Payload to message. Status::payload_malformed: an array count beyond its bound, or fewer bytes than the
// message needs. (DSDL would read missing bytes as zeros. Here both ends have the same definitions, so they
// are a fault.) More bytes than needed are ignored: a later version may append fields. On failure `message`
// holds no usable value. Numbers are taken as they come, NaN included. Any context; not for large messages in
// an interrupt.
template <class Message>
Status deserialize(std::span<const std::uint8_t> payload, Message& message);

// The messages' bounds are the capacities of the runtime, where it has all modes.
static_assert(palpate_ModelState_1_0_displacement_ARRAY_CAPACITY_ == 3 * kMaxSurfaceNodes);
static_assert(palpate_ModelState_1_0_load_ARRAY_CAPACITY_ == kMostModes);
static_assert(palpate_ModelState_1_0_q_ARRAY_CAPACITY_ == kMostModes);
static_assert(palpate_ModelState_1_0_p_ARRAY_CAPACITY_ == kMostModes);
static_assert((kMaxBasisBytes + palpate_ModelPart_1_0_BLOCK_BYTES - 1) / palpate_ModelPart_1_0_BLOCK_BYTES <=
              8 * palpate_BasisReport_1_0_missing_ARRAY_CAPACITY_);

}  // namespace palpate::wire
