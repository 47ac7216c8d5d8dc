#include "shared/wire/cobs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes encode(const Bytes& packet) {
  Bytes out(cobs_max_bytes(packet.size()));
  CobsEncoder encoder(out);
  encoder.put(packet);
  const std::size_t length = encoder.finish();
  EXPECT_GT(length, 0u);
  out.resize(length);
  return out;
}

struct Decoded {
  Bytes packet;
  bool delimited = false;
  bool whole = false;
};

// Decodes one packet, given in runs of at most `run` bytes.
Decoded decode(const Bytes& encoded, std::size_t run) {
  Decoded result;
  result.packet.resize(encoded.size());
  std::size_t length = 0;
  CobsDecoder decoder;
  for (std::size_t at = 0; at < encoded.size() && !result.delimited;) {
    const std::span<const std::uint8_t> in =
        std::span(encoded).subspan(at, std::min(run, encoded.size() - at));
    const auto step = decoder.decode(in, std::span(result.packet).subspan(length));
    at += step.consumed;
    length += step.written;
    result.delimited = step.stop == CobsDecoder::Stop::delimiter;
    EXPECT_NE(step.stop, CobsDecoder::Stop::output_full);
    if (!result.delimited) {
      EXPECT_EQ(step.consumed, in.size());
    }
  }
  result.whole = decoder.whole();
  result.packet.resize(length);
  return result;
}

void expect_round_trip(const Bytes& packet) {
  Bytes encoded = encode(packet);
  EXPECT_LE(encoded.size(), cobs_max_bytes(packet.size()));
  EXPECT_EQ(std::count(encoded.begin(), encoded.end(), kCobsDelimiter), 0);
  encoded.push_back(kCobsDelimiter);
  for (const std::size_t run :
       {std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{253}, encoded.size()}) {
    const Decoded decoded = decode(encoded, run);
    EXPECT_TRUE(decoded.delimited);
    EXPECT_TRUE(decoded.whole);
    EXPECT_EQ(decoded.packet, packet);
  }
}

// The examples of the paper's and the encyclopaedia's tables.
TEST(Cobs, KnownEncodings) {
  EXPECT_EQ(encode({}), (Bytes{0x01}));
  EXPECT_EQ(encode({0x00}), (Bytes{0x01, 0x01}));
  EXPECT_EQ(encode({0x00, 0x00}), (Bytes{0x01, 0x01, 0x01}));
  EXPECT_EQ(encode({0x11, 0x22, 0x00, 0x33}), (Bytes{0x03, 0x11, 0x22, 0x02, 0x33}));
  EXPECT_EQ(encode({0x11, 0x00, 0x00, 0x00}), (Bytes{0x02, 0x11, 0x01, 0x01, 0x01}));
}

// Runs without a zero around the longest block: 254 fill one exactly, and nothing is opened after it.
TEST(Cobs, LengthsAroundTheLongestBlock) {
  for (std::size_t length : {252u, 253u, 254u, 255u, 256u, 507u, 508u, 509u, 762u}) {
    const Bytes ones(length, 0x01);
    EXPECT_EQ(encode(ones).size(), length + (length + kCobsRun - 1) / kCobsRun) << length;
    expect_round_trip(ones);
    Bytes zero_behind = ones, zero_before = ones;
    zero_behind.push_back(0);
    zero_before.insert(zero_before.begin(), 0);
    expect_round_trip(zero_behind);
    expect_round_trip(zero_before);
  }
}

TEST(Cobs, RoundTripOfRandomPackets) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const std::size_t length = random() % 1200;
    const unsigned zeros_per_256 = random() % 256;  // from almost none to almost only zeros
    Bytes packet(length);
    for (std::uint8_t& byte : packet)
      byte = random() % 256 < zeros_per_256 ? std::uint8_t{0} : static_cast<std::uint8_t>(1 + random() % 255);
    expect_round_trip(packet);
  }
}

TEST(Cobs, PiecesGiveTheSameAsTheWhole) {
  Bytes packet(600, 0x55);
  packet[0] = packet[100] = packet[354] = packet[599] = 0;
  const Bytes whole = encode(packet);
  for (std::size_t cut = 0; cut <= packet.size(); ++cut) {
    Bytes out(cobs_max_bytes(packet.size()));
    CobsEncoder encoder(out);
    encoder.put(std::span(packet).first(cut));
    encoder.put(std::span(packet).subspan(cut));
    out.resize(encoder.finish());
    ASSERT_EQ(out, whole) << cut;
  }
}

// A span of the exact length suffices; any shorter one is reported, and nothing is written behind it.
TEST(Cobs, EncoderKeepsWithinItsSpan) {
  for (const Bytes& packet :
       {Bytes{}, Bytes{0}, Bytes(254, 1), Bytes(255, 1), Bytes(300, 0), Bytes{1, 0, 2, 0}}) {
    const Bytes whole = encode(packet);
    for (std::size_t room = 0; room <= whole.size(); ++room) {
      Bytes out(whole.size() + 1, 0xEE);
      CobsEncoder encoder(std::span<std::uint8_t>(out).first(room));
      encoder.put(packet);
      EXPECT_EQ(encoder.finish(), room == whole.size() ? whole.size() : 0u);
      EXPECT_EQ(std::count(out.begin() + static_cast<std::ptrdiff_t>(room), out.end(), 0xEE),
                static_cast<std::ptrdiff_t>(out.size() - room));
    }
  }
}

TEST(Cobs, DecoderKeepsWithinItsSpan) {
  Bytes encoded = encode({1, 2, 0, 3, 4, 0, 0, 5});
  encoded.push_back(kCobsDelimiter);
  for (std::size_t room = 0; room < 8; ++room) {
    Bytes out(9, 0xEE);
    CobsDecoder decoder;
    const auto step = decoder.decode(encoded, std::span(out).first(room));
    EXPECT_EQ(step.stop, CobsDecoder::Stop::output_full);
    EXPECT_EQ(step.written, room);
    EXPECT_TRUE(std::all_of(out.begin() + static_cast<std::ptrdiff_t>(room), out.end(),
                            [](std::uint8_t byte) { return byte == 0xEE; }));
  }
}

TEST(Cobs, CutPacketIsNotWhole) {
  const Bytes encoded = encode({1, 2, 3, 4, 5});
  for (std::size_t length = 1; length < encoded.size(); ++length) {
    Bytes cut(encoded.begin(), encoded.begin() + static_cast<std::ptrdiff_t>(length));
    cut.push_back(kCobsDelimiter);
    EXPECT_FALSE(decode(cut, cut.size()).whole);
  }
}

}  // namespace
}  // namespace palpate::wire
