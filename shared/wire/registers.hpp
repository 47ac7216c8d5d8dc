// Registers of a Cyphal node: uavcan.register.Access.1.0 and uavcan.register.List.1.0, what a board's
// parameters are read and written by.
//
// The standard's types, as in node.hpp: written here without generated code, held against the public
// definitions by hil_tests/test_board_registers.py. Of the standard's kinds of values this project has three.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "shared/wire/messages.hpp"

namespace palpate::wire {

// Tags of the union uavcan.register.Value.1.0.
enum class RegisterType : std::uint8_t {
  empty = 0,  // in a request: read only; in a response: there is no such register
  integer32 = 5,
  real32 = 13,
  other = 255,  // of a request: a kind that no register here has
};
inline constexpr std::size_t kMaxRegisterValues = 12;

struct RegisterValue {
  RegisterType type = RegisterType::empty;
  std::uint8_t count = 0;
  // The bits of an int32 or a float, which the wire has in the same four bytes.
  std::array<std::uint32_t, kMaxRegisterValues> bits{};
  bool operator==(const RegisterValue&) const = default;
};

// Names are views of somebody else's text; of a request that was read, of its payload.
struct RegisterAccessRequest {
  std::string_view name;
  RegisterValue value;
};
struct RegisterAccessResponse {
  std::uint64_t read_us = 0;  // 56 bits; by the board's ticks
  bool is_mutable = false;
  bool is_persistent = false;
  RegisterValue value;
};
struct RegisterListRequest {
  std::uint16_t index = 0;
};
struct RegisterListResponse {
  std::string_view name;  // empty: there is none of that index
};

// The longest name of a register here; the standard allows 255.
inline constexpr std::size_t kMaxRegisterName = 40;
inline constexpr std::size_t kMaxRegisterValueBytes = 2 + 4 * kMaxRegisterValues;

template <>
struct MessageTraits<RegisterAccessRequest>
    : BasicMessageTraits<request_specifier(kRegisterAccessService),
                         1 + kMaxRegisterName + kMaxRegisterValueBytes> {};
template <>
struct MessageTraits<RegisterAccessResponse>
    : BasicMessageTraits<response_specifier(kRegisterAccessService), 8 + kMaxRegisterValueBytes> {};
template <>
struct MessageTraits<RegisterListRequest> : BasicMessageTraits<request_specifier(kRegisterListService), 2> {};
template <>
struct MessageTraits<RegisterListResponse>
    : BasicMessageTraits<response_specifier(kRegisterListService), 1 + kMaxRegisterName> {};

// As in messages.hpp. A value of a kind that no register here has is read as RegisterType::other; one of more
// elements than kMaxRegisterValues, too. Longer names are read whole; only shorter ones are written.
template <>
Status serialize(const RegisterAccessRequest& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status serialize(const RegisterAccessResponse& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status serialize(const RegisterListRequest& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status serialize(const RegisterListResponse& message, std::span<std::uint8_t> out, std::size_t& written);
template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterAccessRequest& message);
template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterAccessResponse& message);
template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterListRequest& message);
template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterListResponse& message);

}  // namespace palpate::wire
