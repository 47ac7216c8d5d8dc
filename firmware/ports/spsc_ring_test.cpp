#include "firmware/ports/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <thread>
#include <vector>

namespace palpate::firmware {
namespace {

TEST(SpscRing, HoldsExactlyItsCapacity) {
  SpscRing<int, 4> ring;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(ring.push(i));
  EXPECT_FALSE(ring.push(4));
  EXPECT_EQ(ring.free(), 0u);
  for (int i = 0; i < 4; ++i) {
    int value = -1;
    EXPECT_TRUE(ring.pop(value));
    EXPECT_EQ(value, i);
  }
  int value = -1;
  EXPECT_FALSE(ring.pop(value));
}

TEST(SpscRing, WritesAllOrNothing) {
  SpscRing<int, 4> ring;
  const std::array<int, 3> three{1, 2, 3};
  EXPECT_TRUE(ring.write(three));
  EXPECT_FALSE(ring.write(three));
  EXPECT_EQ(ring.size(), 3u);
  std::array<int, 8> out{};
  EXPECT_EQ(ring.read(out), 3u);
  EXPECT_EQ(out[2], 3);
}

TEST(SpscRing, WhatIsPeekedStaysUntilItIsSkipped) {
  SpscRing<int, 4> ring;
  EXPECT_TRUE(ring.write(std::array{1, 2, 3}));
  std::array<int, 2> out{};
  EXPECT_EQ(ring.peek(out), 2u);
  EXPECT_EQ(out, (std::array{1, 2}));
  EXPECT_EQ(ring.size(), 3u);
  ring.skip(1);
  EXPECT_TRUE(ring.write(std::array{4, 5}));
  std::array<int, 8> rest{};
  EXPECT_EQ(ring.peek(rest), 4u);
  EXPECT_EQ(rest[0], 2);
  EXPECT_EQ(rest[3], 5);
}

// Blocks of every length across the end of the storage, many times round.
TEST(SpscRing, KeepsOrderAcrossItsEnd) {
  SpscRing<std::uint32_t, 16> ring;
  std::uint32_t written = 0;
  std::uint32_t read = 0;
  for (std::uint32_t round = 0; round < 500; ++round) {
    std::vector<std::uint32_t> block(round % 17);
    for (auto& value : block) value = written++;
    if (!ring.write(block)) written -= static_cast<std::uint32_t>(block.size());
    std::vector<std::uint32_t> out(round % 13);
    const std::size_t count = ring.read(out);
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(out[i], read++);
  }
  EXPECT_EQ(written - read, ring.size());
}

// One thread on each side; ThreadSanitizer watches (preset host-tsan).
TEST(SpscRing, TwoThreadsSeeOneSequence) {
  constexpr std::uint32_t kCount = 200'000;
  SpscRing<std::uint32_t, 64> ring;
  std::thread producer([&] {
    for (std::uint32_t i = 0; i < kCount;) {
      if (ring.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint32_t expected = 0;
  while (expected < kCount) {
    std::array<std::uint32_t, 7> out{};
    const std::size_t count = ring.read(out);
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(out[i], expected++);
    if (count == 0) std::this_thread::yield();
  }
  producer.join();
  EXPECT_EQ(ring.size(), 0u);
}

}  // namespace
}  // namespace palpate::firmware
