#include "shared/wire/registers.hpp"

#include <algorithm>

namespace palpate::wire {
namespace {

constexpr std::uint8_t kMutable = 1, kPersistent = 2;
constexpr std::size_t kTime_bytes = 7;

// Bytes out, as far as there is room.
class Out {
 public:
  explicit Out(std::span<std::uint8_t> bytes) : bytes_(bytes) {}
  void put(std::uint64_t value, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) {
      if (at_ < bytes_.size()) bytes_[at_] = static_cast<std::uint8_t>(value >> (8 * i));
      ++at_;
    }
  }
  void put(std::string_view name) {
    put(name.size(), 1);
    for (const char one : name) put(static_cast<std::uint8_t>(one), 1);
  }
  void put(const RegisterValue& value) {
    put(static_cast<std::uint8_t>(value.type), 1);
    if (value.type == RegisterType::empty) return;
    put(value.count, 1);
    for (std::size_t i = 0; i < value.count; ++i) put(value.bits[i], 4);
  }
  Status end(std::size_t& written) const {
    if (at_ > bytes_.size()) return Status::payload_malformed;
    written = at_;
    return Status::ok;
  }

 private:
  std::span<std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

// Bytes in; what is not there any more is zero, and noticed.
class In {
 public:
  explicit In(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  std::uint64_t take(std::size_t bytes) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i, ++at_)
      if (at_ < bytes_.size()) value |= std::uint64_t{bytes_[at_]} << (8 * i);
    return value;
  }
  std::string_view take_name() {
    const auto length = static_cast<std::size_t>(take(1));
    const std::size_t begin = std::min(at_, bytes_.size());
    at_ += length;
    if (!good()) return {};
    return {reinterpret_cast<const char*>(bytes_.data()) + begin, length};
  }
  RegisterValue take_value() {
    const auto tag = static_cast<std::uint8_t>(take(1));
    RegisterValue value;
    value.type = static_cast<RegisterType>(tag);
    if (value.type == RegisterType::empty) return value;
    const bool is_known = value.type == RegisterType::integer32 || value.type == RegisterType::real32;
    const auto count = static_cast<std::size_t>(is_known ? take(1) : 0);
    if (!is_known || count > kMaxRegisterValues) return {.type = RegisterType::other};
    value.count = static_cast<std::uint8_t>(count);
    for (std::size_t i = 0; i < count; ++i) value.bits[i] = static_cast<std::uint32_t>(take(4));
    return value;
  }
  [[nodiscard]] bool good() const { return at_ <= bytes_.size(); }
  [[nodiscard]] Status end() const { return good() ? Status::ok : Status::payload_malformed; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

bool fits(const RegisterValue& value) {
  return value.type != RegisterType::other && value.count <= kMaxRegisterValues;
}

}  // namespace

template <>
Status serialize(const RegisterAccessRequest& message, std::span<std::uint8_t> out, std::size_t& written) {
  if (message.name.size() > kMaxRegisterName || !fits(message.value)) return Status::payload_malformed;
  Out to(out);
  to.put(message.name);
  to.put(message.value);
  return to.end(written);
}

template <>
Status serialize(const RegisterAccessResponse& message, std::span<std::uint8_t> out, std::size_t& written) {
  if (!fits(message.value)) return Status::payload_malformed;
  Out to(out);
  to.put(message.read_us, kTime_bytes);
  to.put((message.is_mutable ? kMutable : 0u) | (message.is_persistent ? kPersistent : 0u), 1);
  to.put(message.value);
  return to.end(written);
}

template <>
Status serialize(const RegisterListRequest& message, std::span<std::uint8_t> out, std::size_t& written) {
  Out to(out);
  to.put(message.index, 2);
  return to.end(written);
}

template <>
Status serialize(const RegisterListResponse& message, std::span<std::uint8_t> out, std::size_t& written) {
  if (message.name.size() > kMaxRegisterName) return Status::payload_malformed;
  Out to(out);
  to.put(message.name);
  return to.end(written);
}

template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterAccessRequest& message) {
  In from(payload);
  message.name = from.take_name();
  message.value = from.take_value();
  return from.end();
}

template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterAccessResponse& message) {
  In from(payload);
  message.read_us = from.take(kTime_bytes);
  const std::uint64_t flags = from.take(1);
  message.is_mutable = (flags & kMutable) != 0;
  message.is_persistent = (flags & kPersistent) != 0;
  message.value = from.take_value();
  return from.end();
}

template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterListRequest& message) {
  In from(payload);
  message.index = static_cast<std::uint16_t>(from.take(2));
  return from.end();
}

template <>
Status deserialize(std::span<const std::uint8_t> payload, RegisterListResponse& message) {
  In from(payload);
  message.name = from.take_name();
  return from.end();
}

}  // namespace palpate::wire
