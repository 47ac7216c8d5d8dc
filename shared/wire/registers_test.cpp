#include "shared/wire/registers.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <string>
#include <vector>

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Message>
Bytes to_bytes(const Message& message) {
  Bytes out(MessageTraits<Message>::kMaxBytes, 0xEE);
  std::size_t written = 0;
  EXPECT_EQ(serialize(message, out, written), Status::ok);
  out.resize(written);
  return out;
}

RegisterValue reals(std::initializer_list<float> values) {
  RegisterValue value{.type = RegisterType::real32};
  for (const float one : values) value.bits[value.count++] = std::bit_cast<std::uint32_t>(one);
  return value;
}

TEST(Registers, ARequestToReadHasANameAndAnEmptyValue) {
  EXPECT_EQ(to_bytes(RegisterAccessRequest{"a.b", {}}), (Bytes{3, 'a', '.', 'b', 0}));
}

TEST(Registers, ARequestToWriteHasItsValueBehindTagAndLength) {
  EXPECT_EQ(to_bytes(RegisterAccessRequest{"a", reals({1.0f})}), (Bytes{1, 'a', 13, 1, 0, 0, 0x80, 0x3F}));
}

TEST(Registers, AResponseHasTimeFlagsAndValue) {
  const RegisterAccessResponse message{
      0x07060504030201u, true, true, {RegisterType::integer32, 1, {0xFFFFFFFEu}}};
  EXPECT_EQ(to_bytes(message), (Bytes{1, 2, 3, 4, 5, 6, 7, 3, 5, 1, 0xFE, 0xFF, 0xFF, 0xFF}));
}

TEST(Registers, WhatIsWrittenIsRead) {
  const RegisterAccessRequest asked{"arm.sample", reals({1.5f, -2.0f, 0.0f})};
  const Bytes bytes = to_bytes(asked);
  RegisterAccessRequest seen;
  ASSERT_EQ(deserialize(bytes, seen), Status::ok);
  EXPECT_EQ(seen.name, asked.name);
  EXPECT_EQ(seen.value, asked.value);
  const RegisterAccessResponse answer{12'000, false, true, reals({3.0f})};
  RegisterAccessResponse heard;
  ASSERT_EQ(deserialize(to_bytes(answer), heard), Status::ok);
  EXPECT_EQ(heard.read_us, 12'000u);
  EXPECT_FALSE(heard.is_mutable);
  EXPECT_TRUE(heard.is_persistent);
  EXPECT_EQ(heard.value, answer.value);
  RegisterListRequest index;
  ASSERT_EQ(deserialize(to_bytes(RegisterListRequest{0x0102}), index), Status::ok);
  EXPECT_EQ(index.index, 0x0102);
  const Bytes named = to_bytes(RegisterListResponse{"encoder.sign"});
  RegisterListResponse name;
  ASSERT_EQ(deserialize(named, name), Status::ok);
  EXPECT_EQ(name.name, "encoder.sign");
}

// Every shorter payload is a fault, never a value made of zeros.
TEST(Registers, WhatIsCutShortIsRefused) {
  const Bytes asked = to_bytes(RegisterAccessRequest{"a.b", reals({1.0f, 2.0f})});
  RegisterAccessRequest seen;
  for (std::size_t length = 0; length < asked.size(); ++length)
    EXPECT_EQ(deserialize(std::span(asked).first(length), seen), Status::payload_malformed) << length;
  const Bytes answer = to_bytes(RegisterAccessResponse{1, true, false, reals({1.0f})});
  RegisterAccessResponse heard;
  for (std::size_t length = 0; length < answer.size(); ++length)
    EXPECT_EQ(deserialize(std::span(answer).first(length), heard), Status::payload_malformed) << length;
  RegisterListRequest index;
  EXPECT_EQ(deserialize(Bytes{1}, index), Status::payload_malformed);
  RegisterListResponse name;
  EXPECT_EQ(deserialize(Bytes{2, 'a'}, name), Status::payload_malformed);
}

TEST(Registers, ValuesOfKindsAndLengthsThatNoRegisterHasAreOther) {
  RegisterAccessRequest seen;
  ASSERT_EQ(deserialize(Bytes{1, 'a', 1, 2, 0, 'h', 'i'}, seen), Status::ok);  // string
  EXPECT_EQ(seen.value.type, RegisterType::other);
  Bytes many{1, 'a', 13, kMaxRegisterValues + 1};
  many.resize(many.size() + 4 * (kMaxRegisterValues + 1));
  ASSERT_EQ(deserialize(many, seen), Status::ok);
  EXPECT_EQ(seen.value.type, RegisterType::other);
}

TEST(Registers, WhatDoesNotFitIsNotWritten) {
  Bytes out(8);
  std::size_t written = 0;
  const std::string longest(kMaxRegisterName, 'n');
  EXPECT_EQ(serialize(RegisterListResponse{longest}, out, written), Status::payload_malformed);
  EXPECT_EQ(serialize(RegisterAccessResponse{0, true, true, reals({1.0f})}, out, written),
            Status::payload_malformed);
  out.resize(200);
  EXPECT_EQ(serialize(RegisterAccessRequest{longest + "n", {}}, out, written), Status::payload_malformed);
  EXPECT_EQ(serialize(RegisterAccessRequest{"a", {.type = RegisterType::other}}, out, written),
            Status::payload_malformed);
  EXPECT_EQ(written, 0u);
}

TEST(Registers, TheLongestMessagesAreAsLongAsTheirTraitsSay) {
  RegisterValue value{.type = RegisterType::real32, .count = kMaxRegisterValues};
  const std::string name(kMaxRegisterName, 'n');
  EXPECT_EQ(to_bytes(RegisterAccessRequest{name, value}).size(),
            MessageTraits<RegisterAccessRequest>::kMaxBytes);
  EXPECT_EQ(to_bytes(RegisterAccessResponse{0, true, true, value}).size(),
            MessageTraits<RegisterAccessResponse>::kMaxBytes);
  EXPECT_EQ(to_bytes(RegisterListResponse{name}).size(), MessageTraits<RegisterListResponse>::kMaxBytes);
}

}  // namespace
}  // namespace palpate::wire
