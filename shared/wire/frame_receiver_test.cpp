#include "shared/wire/frame_receiver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "shared/wire/messages.hpp"

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kCapacity = 1024;
using Receiver = FrameReceiver<kCapacity>;

struct Delivered {
  FrameHeader header;
  Bytes payload;
  bool operator==(const Delivered&) const = default;
};

Bytes encode(const Delivered& frame) {
  Bytes out(max_frame_bytes(frame.payload.size()));
  out.resize(encode_frame(frame.header, frame.payload, out));
  return out;
}

// Feeds bytes in runs of at most `run`, and returns every frame that came out.
template <class AnyReceiver>
std::vector<Delivered> feed(AnyReceiver& receiver, std::span<const std::uint8_t> bytes,
                            std::size_t run = 4096) {
  std::vector<Delivered> delivered;
  while (!bytes.empty()) {
    std::span<const std::uint8_t> piece = bytes.first(std::min(run, bytes.size()));
    bytes = bytes.subspan(piece.size());
    while (!piece.empty()) {
      const Reception reception = receiver.receive(piece);
      if (reception.complete) {
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reception.frame.payload.data()) % 8, 0u);
        delivered.push_back(
            {reception.frame.header, Bytes(reception.frame.payload.begin(), reception.frame.payload.end())});
      } else {
        EXPECT_EQ(reception.consumed, piece.size());
      }
      piece = piece.subspan(reception.consumed);
    }
  }
  return delivered;
}

// Payloads with zeros now and then, like those of real messages.
Delivered sample(std::size_t payload_bytes, std::uint32_t seed) {
  std::mt19937 random(seed);
  Delivered frame{{.priority = Priority::high,
                   .source = kBoardNode,
                   .destination = kHostNode,
                   .specifier = message_specifier(kServoTraceSubject),
                   .transfer_id = seed},
                  Bytes(payload_bytes)};
  for (std::uint8_t& byte : frame.payload)
    byte = random() % 4 == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(random() & 0xFF);
  return frame;
}

Bytes operator+(Bytes left, const Bytes& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

Bytes flip(Bytes bytes, std::size_t bit) {
  bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ (1u << (bit % 8)));
  return bytes;
}

TEST(FrameReceiver, FramesBackToBackInRunsOfEveryLength) {
  const std::vector<Delivered> frames{sample(0, 1), sample(1, 2), sample(300, 3), sample(kCapacity, 4),
                                      sample(8, 5)};
  Bytes stream;
  for (const Delivered& frame : frames) stream = stream + encode(frame);
  for (std::size_t run = 1; run <= stream.size(); run += run < 70 ? 1 : 97) {
    Receiver receiver;
    ASSERT_EQ(feed(receiver, stream, run), frames) << run;
    ASSERT_EQ(receiver.counters().frames, frames.size());
    ASSERT_EQ(receiver.counters().refused(), 0u);
  }
}

TEST(FrameReceiver, FramesMayShareADelimiter) {
  const Delivered first = sample(20, 1), second = sample(30, 2);
  Bytes stream = encode(first);
  stream.pop_back();
  stream = stream + encode(second);
  Receiver receiver;
  EXPECT_EQ(feed(receiver, stream), (std::vector{first, second}));
}

TEST(FrameReceiver, IdleDelimitersAreNoFault) {
  Receiver receiver;
  const Delivered frame = sample(20, 1);
  EXPECT_EQ(feed(receiver, Bytes(100, 0) + encode(frame) + Bytes(100, 0)), (std::vector{frame}));
  EXPECT_EQ(receiver.counters().refused(), 0u);
}

// Every single-bit corruption of a frame between two good ones: that frame is refused, the others arrive.
TEST(FrameReceiver, EverySingleBitCorruptionIsDetected) {
  const Delivered before = sample(40, 1), after = sample(50, 2);
  for (const std::size_t payload_bytes : {0u, 1u, 8u, 28u, 225u, 226u, 227u, 254u, 500u, 905u}) {
    const Bytes good = encode(sample(payload_bytes, static_cast<std::uint32_t>(payload_bytes)));
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
      Receiver receiver;
      ASSERT_EQ(feed(receiver, encode(before) + flip(good, bit) + encode(after)),
                (std::vector{before, after}))
          << payload_bytes << " bytes, bit " << bit;
      ASSERT_GE(receiver.counters().refused(), 1u);
    }
  }
}

// The same for the longest frame of this link, one bit in 151 of it.
TEST(FrameReceiver, SingleBitCorruptionOfTheLongestFrameIsDetected) {
  const Delivered frame = sample(kLargestPayloadToBoard, 3), after = sample(50, 2);
  const Bytes good = encode(frame);
  FrameReceiver<kLargestPayloadToBoard> receiver;
  ASSERT_EQ(feed(receiver, good, good.size()), (std::vector{frame}));
  for (std::size_t bit = 0; bit < 8 * good.size(); bit += 151)
    ASSERT_EQ(feed(receiver, flip(good, bit) + encode(after), good.size()), (std::vector{after})) << bit;
}

// Two flipped bits in a short frame, every pair.
TEST(FrameReceiver, EveryDoubleBitCorruptionOfAShortFrameIsDetected) {
  const Delivered frame = sample(12, 3), after = sample(5, 2);
  const Bytes good = encode(frame), tail = encode(after);
  Receiver receiver;
  for (std::size_t first = 0; first < 8 * good.size(); ++first)
    for (std::size_t second = 0; second < first; ++second)
      ASSERT_EQ(feed(receiver, flip(flip(good, first), second) + tail), (std::vector{after}))
          << first << ' ' << second;
}

// A frame cut at any length: without its last delimiter it is complete (the next frame begins with one),
// shorter it is refused. The next frame always arrives.
TEST(FrameReceiver, TruncationAtEveryLength) {
  const Delivered after = sample(50, 2);
  for (const std::size_t payload_bytes : {0u, 7u, 300u}) {
    const Delivered frame = sample(payload_bytes, 7);
    const Bytes good = encode(frame);
    for (std::size_t length = 0; length < good.size(); ++length) {
      Receiver receiver;
      const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length));
      const bool complete = length == good.size() - 1;
      ASSERT_EQ(feed(receiver, cut + encode(after)),
                complete ? (std::vector{frame, after}) : (std::vector{after}));
      ASSERT_EQ(receiver.counters().refused(), complete || length <= 1 ? 0u : 1u) << length;
    }
  }
}

// A receiver that starts in the middle of a frame.
TEST(FrameReceiver, StartAtEveryByte) {
  const Delivered frame = sample(300, 7), after = sample(50, 2);
  const Bytes good = encode(frame);
  for (std::size_t start = 2; start < good.size(); ++start) {
    Receiver receiver;
    const Bytes cut(good.begin() + static_cast<std::ptrdiff_t>(start), good.end());
    ASSERT_EQ(feed(receiver, cut + encode(after)), (std::vector{after})) << start;
  }
}

TEST(FrameReceiver, GarbageBetweenFrames) {
  const Delivered frame = sample(100, 1), after = sample(50, 2);
  Bytes garbage(5000, 0xA5);  // without a delimiter, longer than the buffer
  Receiver receiver;
  EXPECT_EQ(feed(receiver, garbage + encode(frame) + garbage + encode(after)), (std::vector{frame, after}));
  EXPECT_EQ(receiver.counters().refused(), 2u);
}

TEST(FrameReceiver, OversizedFrameIsRefusedWhateverItsLength) {
  const Delivered after = sample(50, 2);
  for (std::size_t excess = 1; excess < 600; ++excess) {
    Receiver receiver;
    ASSERT_EQ(feed(receiver, encode(sample(kCapacity + excess, 1)) + encode(after)), (std::vector{after}));
    ASSERT_EQ(receiver.counters().of(Status::frame_too_long), 1u);
    ASSERT_EQ(receiver.counters().refused(), 1u);
  }
}

// A packet with any content, as it stands on the wire.
Bytes packet(const Bytes& content) {
  Bytes out(cobs_max_bytes(content.size()) + 2, 0);
  CobsEncoder encoder(std::span<std::uint8_t>(out).subspan(1));
  encoder.put(content);
  out.resize(encoder.finish() + 2);
  out.back() = kCobsDelimiter;
  return out;
}

Bytes header_bytes() {
  std::array<std::uint8_t, kHeaderBytes> header{};
  write_header({.source = kBoardNode, .specifier = 1600}, header);
  return {header.begin(), header.end()};
}

TEST(FrameReceiver, EachFaultHasItsStatusAndCounter) {
  Receiver receiver;
  const auto expect_fault = [&receiver](const Bytes& bytes, Status fault) {
    const std::uint32_t before = receiver.counters().of(fault), all = receiver.counters().refused();
    EXPECT_TRUE(feed(receiver, bytes).empty());
    EXPECT_EQ(receiver.counters().of(fault), before + 1);
    EXPECT_EQ(receiver.counters().refused(), all + 1);
    EXPECT_EQ(receiver.counters().last_fault, fault);
  };
  expect_fault(Bytes(4000, 1) + Bytes{0}, Status::frame_too_long);
  expect_fault(packet({}), Status::frame_too_short);
  expect_fault(packet(Bytes(kFrameOverheadBytes - 1, 1)), Status::frame_too_short);
  expect_fault({0x05, 0x01, 0x00}, Status::cobs_invalid);
  expect_fault(packet(Bytes(kFrameOverheadBytes, 1)), Status::header_crc_mismatch);
  expect_fault(packet(header_bytes() + Bytes{1, 2, 3, 4}), Status::payload_crc_mismatch);

  Bytes fragment = header_bytes();
  fragment[19] = 0;  // not the end of its transfer
  const std::uint16_t crc = crc16(std::span(fragment).first(22));
  fragment[22] = static_cast<std::uint8_t>(crc >> 8);
  fragment[23] = static_cast<std::uint8_t>(crc & 0xFF);
  expect_fault(packet(fragment + Bytes{0, 0, 0, 0}), Status::not_a_single_frame);
  EXPECT_EQ(receiver.counters().frames, 0u);
}

// Noise: nothing is delivered from it (a wrong delivery has a chance of 2^-48 a frame), whatever its share of
// zeros.
TEST(FrameReceiver, RandomBytesDeliverNothing) {
  std::mt19937 random(1);
  for (const unsigned zeros_per_256 : {1u, 8u, 64u, 128u}) {
    Receiver receiver;
    Bytes noise(200'000);
    for (std::uint8_t& byte : noise)
      byte = random() % 256 < zeros_per_256 ? std::uint8_t{0} : static_cast<std::uint8_t>(random() & 0xFF);
    EXPECT_TRUE(feed(receiver, noise, 37).empty());
    EXPECT_GT(receiver.counters().refused(), 0u);
  }
}

// Streams of good frames with bits flipped, bytes removed, inserted and doubled, in runs of random length:
// what comes out is one of the frames that went in, in their order, and those that were not hit all come out.
TEST(FrameReceiver, DamagedStreamsDeliverOnlyWhatWasSent) {
  std::mt19937 random(2);
  std::size_t hit_frames = 0, delivered_frames = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<Delivered> sent, unharmed;
    Bytes stream;
    for (std::uint32_t i = 0; i < 12; ++i) {
      sent.push_back(sample(random() % 400, i));
      Bytes bytes = encode(sent.back());
      const auto position = [&] { return static_cast<std::ptrdiff_t>(random() % bytes.size()); };
      switch (random() % 8) {
        case 0:
          bytes = flip(bytes, random() % (8 * bytes.size()));
          break;
        case 1:
          bytes.erase(bytes.begin() + position());
          break;
        case 2:
          bytes.insert(bytes.begin() + position(), static_cast<std::uint8_t>(random() & 0xFF));
          break;
        case 3:
          bytes.erase(bytes.begin() + position(), bytes.end());
          break;
        default:
          unharmed.push_back(sent.back());
      }
      stream = stream + bytes;
    }
    hit_frames += sent.size() - unharmed.size();
    Receiver receiver;
    const std::vector<Delivered> delivered = feed(receiver, stream, 1 + random() % 300);
    delivered_frames += delivered.size();
    std::size_t at = 0, found = 0;
    for (const Delivered& frame : delivered) {
      while (at < sent.size() && sent[at] != frame) ++at;
      ASSERT_LT(at, sent.size()) << "a frame that was not sent, or twice";
      ++at;
      if (std::find(unharmed.begin(), unharmed.end(), frame) != unharmed.end()) ++found;
    }
    ASSERT_EQ(found, unharmed.size());
  }
  EXPECT_GT(hit_frames, 1000u);  // the test has hit something
  EXPECT_GT(delivered_frames, 1000u);
}

}  // namespace
}  // namespace palpate::wire
