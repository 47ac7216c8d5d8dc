#include "shared/wire/can_record.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct Sent {
  std::uint32_t identifier = 0;
  bool fd = false;
  Bytes data;
  bool operator==(const Sent&) const = default;
};

Bytes record(const Sent& frame) {
  Bytes out(kMaxCanRecordBytes);
  out.resize(write_can_record({frame.identifier, frame.fd, frame.data}, out));
  return out;
}

Sent sample(std::uint32_t seed, bool fd) {
  std::mt19937 random(seed);
  Sent frame{.identifier = static_cast<std::uint32_t>(random() & 0x1FFFFFFFu), .fd = fd, .data = {}};
  frame.data.resize(kCanDataLengths[random() % (fd ? 16 : 9)]);
  for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random() & 0xFF);
  return frame;
}

// What a reader finds, fed in runs of at most `run`. `damages`: how often it lost the records.
std::vector<Sent> read(CanRecordReader& reader, std::span<const std::uint8_t> bytes, std::size_t run,
                       std::size_t& damages) {
  std::vector<Sent> frames;
  while (!bytes.empty()) {
    std::span<const std::uint8_t> piece = bytes.first(std::min(run, bytes.size()));
    bytes = bytes.subspan(piece.size());
    while (true) {
      const CanRecordReader::Step step = reader.read(piece);
      piece = piece.subspan(step.consumed);
      if (step.found == CanRecordReader::Found::nothing) break;
      if (step.found == CanRecordReader::Found::damage) {
        ++damages;
      } else {
        frames.push_back(
            {step.frame.identifier, step.frame.fd, Bytes(step.frame.data.begin(), step.frame.data.end())});
      }
    }
    EXPECT_TRUE(piece.empty());
  }
  return frames;
}

Bytes operator+(Bytes left, const Bytes& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

// By hand from the layout, but for the CRC (crc_test.cpp has its check value).
TEST(CanRecord, Layout) {
  const Bytes classic = record({0x1064D201u, false, {0x01, 0x02, 0x03, 0xE0}});
  EXPECT_EQ(Bytes(classic.begin(), classic.end() - 2),
            (Bytes{0x01, 0xD2, 0x64, 0x90, 0xB4, 0x01, 0x02, 0x03, 0xE0}));
  const std::uint16_t check = crc16(std::span(classic).first(9));
  EXPECT_EQ(256u * classic[9] + classic[10], check);
  const Bytes fd = record({0x0E4B452Au, true, Bytes(12, 0x55)});
  EXPECT_EQ(Bytes(fd.begin(), fd.begin() + 5), (Bytes{0x2A, 0x45, 0x4B, 0xCE, 0x69}));
  EXPECT_EQ(fd.size(), 12 + kCanRecordOverheadBytes);
}

TEST(CanRecord, WhatIsNoFrameIsNotWritten) {
  Bytes out(kMaxCanRecordBytes, 0xAA);
  const Bytes data(64);
  EXPECT_EQ(write_can_record({1u << 29, false, std::span(data).first(8)}, out), 0u);
  EXPECT_EQ(write_can_record({1, false, std::span(data).first(9)}, out), 0u);
  EXPECT_EQ(write_can_record({1, false, std::span(data).first(12)}, out), 0u);
  EXPECT_EQ(write_can_record({1, true, std::span(data).first(9)}, out), 0u);
  EXPECT_EQ(write_can_record({1, true, std::span(data).first(64)}, std::span(out).first(70)), 0u);
  EXPECT_EQ(out, Bytes(kMaxCanRecordBytes, 0xAA));
  EXPECT_EQ(write_can_record({1, true, std::span(data).first(64)}, out), kMaxCanRecordBytes);
}

TEST(CanRecord, RecordsInRunsOfEveryLength) {
  std::vector<Sent> frames;
  Bytes stream;
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    frames.push_back(sample(seed, seed % 3 == 0));
    stream = stream + record(frames.back());
  }
  for (std::size_t run = 1; run <= stream.size(); run += run < 90 ? 1 : 97) {
    CanRecordReader reader;
    std::size_t damages = 0;
    ASSERT_EQ(read(reader, stream, run, damages), frames) << run;
    ASSERT_EQ(damages, 0u);
    ASSERT_EQ(reader.held_bytes(), 0u);
  }
}

// Every single-bit error of a record between others, of every length: it is missing, the others are there.
TEST(CanRecord, EverySingleBitErrorIsDetected) {
  const Sent before = sample(1, false), after = sample(2, true), last = sample(5, false);
  for (std::size_t code = 0; code < 16; ++code) {
    Sent hit{.identifier = 0x1064D201u, .fd = code > 8, .data = Bytes(kCanDataLengths[code])};
    for (std::size_t i = 0; i < hit.data.size(); ++i) hit.data[i] = static_cast<std::uint8_t>(37 * i + code);
    const Bytes good = record(hit);
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
      Bytes bad = good;
      bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
      CanRecordReader reader;
      std::size_t damages = 0;
      ASSERT_EQ(read(reader, record(before) + bad + record(after) + record(last), 1 + bit % 50, damages),
                (std::vector{before, after, last}))
          << "length code " << code << ", bit " << bit;
      ASSERT_EQ(damages, 1u);
    }
  }
}

// A record of which bytes are missing, or that others stand before: what comes behind is found. The reader
// may wait for as many bytes as the longest record has, so there are some.
TEST(CanRecord, FindsItsWayBack) {
  const std::vector<Sent> rest{sample(1, false), sample(2, true), sample(4, true), sample(7, true)};
  Bytes tail;
  for (const Sent& frame : rest) tail = tail + record(frame);
  ASSERT_GT(tail.size(), 2 * kMaxCanRecordBytes);
  const Bytes hit = record(sample(9, true));
  for (std::size_t length = 1; length < hit.size(); ++length) {
    CanRecordReader reader;
    std::size_t damages = 0;
    const Bytes cut(hit.begin() + static_cast<std::ptrdiff_t>(length), hit.end());
    ASSERT_EQ(read(reader, cut + tail, 7, damages), rest) << length;
    ASSERT_EQ(damages, 1u);
  }
}

// Noise: a record is taken from it only by chance, where flags (2 of 8), length code (16 or 9 of 256) and
// check (1 of 65,536) fit: 1.9e-7 a byte.
TEST(CanRecord, NoiseHoldsFewRecords) {
  std::mt19937 random(1);
  constexpr std::size_t kBytes = 8'000'000;
  constexpr double kChance = (1.0 / 8 * 16 + 1.0 / 8 * 9) / 256 / 65536;
  Bytes noise(kBytes);
  for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random() & 0xFF);
  CanRecordReader reader;
  std::size_t damages = 0;
  const double found = static_cast<double>(read(reader, noise, 1000, damages).size());
  EXPECT_LE(found, kChance * kBytes + 6 * std::sqrt(kChance * kBytes));  // six standard deviations
  EXPECT_GT(damages, 0u);
}

}  // namespace
}  // namespace palpate::wire
