#include "host/link/framing.hpp"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

#include "shared/wire/can_receiver.hpp"
#include "shared/wire/frame.hpp"

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr FramingKind kKinds[] = {FramingKind::serial, FramingKind::can_classic, FramingKind::can_fd};

Bytes random_bytes(std::mt19937& random, std::size_t length) {
  Bytes bytes(length);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() & 0xFF);
  return bytes;
}

TEST(Framing, SerialBytesAreThoseOfEncodeFrame) {
  std::mt19937 random(1);
  const std::unique_ptr<Framing> serial = make_framing(FramingKind::serial);
  for (std::size_t length = 0; length < 600; length += 7) {
    const Bytes payload = random_bytes(random, length);
    const wire::FrameHeader header{.source = 10, .specifier = 1610, .transfer_id = length << 33};
    Bytes expected(wire::max_frame_bytes(length));
    expected.resize(wire::encode_frame(header, payload, expected));
    EXPECT_EQ(serial->encode(header, payload), expected);
  }
}

// What one end encodes the other takes: any transfers back to back, cut anywhere.
TEST(Framing, RoundTrip) {
  for (const FramingKind kind : kKinds) {
    std::mt19937 random(2);
    const std::unique_ptr<Framing> sender = make_framing(kind), receiver = make_framing(kind);
    const std::uint64_t id_mask = ~std::uint64_t{0} >> (64 - receiver->transfer_id_bits());
    const auto random_node = [&random] { return static_cast<std::uint16_t>(random() % 128); };
    std::vector<Bytes> payloads;
    std::vector<wire::FrameHeader> headers;
    Bytes stream;
    for (std::uint64_t i = 0; i < 100; ++i) {
      payloads.push_back(random_bytes(random, random() % (i % 10 == 0 ? kReceiverCapacity + 1 : 200)));
      wire::FrameHeader header{
          .priority = static_cast<wire::Priority>(random() % 8),
          .source = random_node(),
          .specifier = wire::message_specifier(static_cast<std::uint16_t>(1600 + i % 20)),
          .transfer_id = i};
      if (i % 3 == 0) {
        header.destination = random_node();
        header.specifier = i % 2 == 0 ? wire::request_specifier(300) : wire::response_specifier(301);
      }
      headers.push_back(header);
      const Bytes bytes = sender->encode(header, payloads.back());
      stream.insert(stream.end(), bytes.begin(), bytes.end());
    }
    std::size_t next = 0;
    for (std::size_t at = 0; at < stream.size();) {
      const std::size_t run = std::min<std::size_t>(1 + random() % 500, stream.size() - at);
      std::span<const std::uint8_t> piece = std::span(stream).subspan(at, run);
      at += run;
      while (true) {
        const wire::Reception reception = receiver->receive(piece, 0);
        piece = piece.subspan(reception.consumed);
        if (!reception.complete) break;
        ASSERT_LT(next, headers.size());
        headers[next].transfer_id &= id_mask;
        EXPECT_EQ(reception.frame.header, headers[next]);
        Bytes payload(reception.frame.payload.begin(), reception.frame.payload.end());
        if (kind == FramingKind::can_fd) {  // padded with zeros
          ASSERT_GE(payload.size(), payloads[next].size());
          for (std::size_t i = payloads[next].size(); i < payload.size(); ++i) EXPECT_EQ(payload[i], 0);
          payload.resize(payloads[next].size());
        }
        EXPECT_EQ(payload, payloads[next]);
        ++next;
      }
    }
    EXPECT_EQ(next, headers.size());
    EXPECT_EQ(receiver->counters().frames, headers.size());
    EXPECT_EQ(receiver->counters().refused(), 0u);
  }
}

TEST(Framing, WhatCanCannotCarryIsRefused) {
  for (const FramingKind kind : {FramingKind::can_classic, FramingKind::can_fd}) {
    const std::unique_ptr<Framing> can = make_framing(kind);
    EXPECT_THROW((void)can->encode({.source = 128, .specifier = 1600}, {}), std::invalid_argument);
    EXPECT_THROW((void)can->encode({.source = 1, .specifier = 8192}, {}), std::invalid_argument);
    EXPECT_THROW((void)can->encode({.source = 1, .destination = 300, .specifier = 0xC000}, {}),
                 std::invalid_argument);
  }
}

}  // namespace
}  // namespace palpate::link
