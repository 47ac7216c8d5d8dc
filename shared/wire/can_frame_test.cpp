#include "shared/wire/can_frame.hpp"

#include <gtest/gtest.h>

namespace palpate::wire {
namespace {

// Identifiers that pycyphal 1.27.0 (MessageCANID, ServiceCANID) made of the same transfers.
TEST(CanFrame, IdentifiersEqualPycyphals) {
  struct Case {
    FrameHeader header;
    std::uint32_t identifier;
  };
  const Case cases[] = {
      {{.priority = Priority::nominal, .source = 1, .specifier = message_specifier(1234)}, 0x1064D201u},
      {{.priority = Priority::high, .source = 42, .specifier = message_specifier(1600)}, 0x0C66402Au},
      {{.priority = Priority::optional, .source = 127, .specifier = message_specifier(8191)}, 0x1C7FFF7Fu},
      {{.source = 10, .destination = 42, .specifier = request_specifier(300)}, 0x134B150Au},
      {{.priority = Priority::high, .source = 42, .destination = 10, .specifier = response_specifier(301)},
       0x0E4B452Au},
  };
  for (const Case& one : cases) {
    std::uint32_t identifier = 0;
    ASSERT_EQ(can_identifier(one.header, identifier), Status::ok);
    EXPECT_EQ(identifier, one.identifier);
    FrameHeader back;
    ASSERT_EQ(parse_can_identifier(identifier, back), Status::ok);
    EXPECT_EQ(back, one.header);
  }
}

TEST(CanFrame, WhatAnIdentifierCannotNameIsRefused) {
  const FrameHeader cases[] = {
      {.source = 128, .specifier = message_specifier(1600)},
      {.source = kBroadcast, .specifier = message_specifier(1600)},
      {.source = 1, .specifier = message_specifier(8192)},
      {.source = 1, .destination = 2, .specifier = message_specifier(1600)},
      {.source = 1, .destination = 2, .specifier = request_specifier(512)},
      {.source = 1, .destination = 128, .specifier = request_specifier(300)},
      {.source = 1, .destination = kBroadcast, .specifier = response_specifier(300)},
  };
  for (const FrameHeader& header : cases) {
    std::uint32_t identifier = 77;
    EXPECT_EQ(can_identifier(header, identifier), Status::not_for_can);
    EXPECT_EQ(identifier, 77u);
  }
}

// Every identifier is either refused for a reserved bit, or says the same again when it is written anew; but
// for bits 22 and 21 of messages, which receivers ignore, and the pseudo-identifier of an anonymous node.
TEST(CanFrame, EveryBitOfAnIdentifierMeansSomething) {
  for (std::uint32_t step = 0; step < (1u << 29); step += 1237) {
    const std::uint32_t identifier = step ^ (step >> 7);
    FrameHeader header;
    const bool service = (identifier & (1u << 25)) != 0;
    const bool reserved = (identifier & (1u << 23)) != 0 || (!service && (identifier & (1u << 7)) != 0);
    const Status status = parse_can_identifier(identifier, header);
    ASSERT_EQ(status, reserved ? Status::header_version_unknown : Status::ok) << identifier;
    if (status != Status::ok) continue;
    if (!service && (identifier & (1u << 24)) != 0) {
      ASSERT_EQ(header.source, kBroadcast);
      continue;
    }
    std::uint32_t again = 0;
    ASSERT_EQ(can_identifier(header, again), Status::ok);
    ASSERT_EQ(again, service ? identifier : identifier | (3u << 21));
  }
}

TEST(CanFrame, TailByte) {
  EXPECT_EQ(can_tail_byte({.start = true, .end = true, .toggle = true, .transfer_id = 0}), 0xE0);
  EXPECT_EQ(can_tail_byte({.start = true, .end = false, .toggle = true, .transfer_id = 5}), 0xA5);
  EXPECT_EQ(can_tail_byte({.start = false, .end = true, .toggle = false, .transfer_id = 31}), 0x5F);
  for (unsigned byte = 0; byte < 256; ++byte)
    EXPECT_EQ(can_tail_byte(parse_can_tail(static_cast<std::uint8_t>(byte))), byte);
}

TEST(CanFrame, LengthCodes) {
  for (std::size_t bytes = 0; bytes <= 8; ++bytes) EXPECT_EQ(can_padded_bytes(bytes), bytes);
  EXPECT_EQ(can_padded_bytes(9), 12u);
  EXPECT_EQ(can_padded_bytes(24), 24u);
  EXPECT_EQ(can_padded_bytes(25), 32u);
  EXPECT_EQ(can_padded_bytes(33), 48u);
  EXPECT_EQ(can_padded_bytes(49), 64u);
  EXPECT_EQ(can_length_code(64), 15u);
}

}  // namespace
}  // namespace palpate::wire
