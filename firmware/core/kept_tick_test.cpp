#include "firmware/core/kept_tick.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::firmware {
namespace {

constexpr KeptTick kSome{
    .tick = 1234,
    .faults = bit(Fault::over_current),
    .heat = {.winding = {0.5f, 1.5f, 0.0f}, .housing = {0.25f, 1.0f, 0.75f}, .pending_ticks = 3}};

bool same(const KeptTick& a, const KeptTick& b) {
  return a.tick == b.tick && a.faults == b.faults && a.heat.winding == b.heat.winding &&
         a.heat.housing == b.heat.housing && a.heat.pending_ticks == b.heat.pending_ticks;
}

TEST(KeptTick, WhatIsKeptIsRecalled) {
  std::array<std::uint32_t, kKeptWords> kept{};
  keep(kSome, kept);
  KeptTick tick;
  ASSERT_TRUE(recall(kept, tick));
  EXPECT_TRUE(same(tick, kSome));
}

// The reset came between two of its words, or one of them has changed by itself.
TEST(KeptTick, APartOfOneIsNone) {
  KeptTick later = kSome;
  later.tick = 1235;
  later.heat.winding[1] = 1.6f;
  later.heat.housing[2] = 0.8f;
  std::array<std::uint32_t, kKeptWords> before{}, after{};
  keep(kSome, before);
  keep(later, after);
  for (std::size_t done = 1; done < kKeptWords; ++done) {
    std::array<std::uint32_t, kKeptWords> half = before;
    std::copy_n(after.begin(), done, half.begin());
    if (half == before || half == after) continue;
    KeptTick tick = kSome;
    EXPECT_FALSE(recall(half, tick)) << done;
    EXPECT_TRUE(same(tick, kSome));
  }
  for (std::size_t i = 0; i < kKeptWords; ++i) {
    std::array<std::uint32_t, kKeptWords> changed = before;
    changed[i] ^= 0x100u;
    KeptTick tick;
    EXPECT_FALSE(recall(changed, tick)) << i;
  }
}

// Words that change places, and bits that move from one word into the next, change it as well: by 5 bits a
// word, so that no two words of a record are turned alike.
TEST(KeptTick, TheCheckKnowsWhereABitIs) {
  EXPECT_EQ(check_of({}), 0x4B455054u);
  EXPECT_EQ(check_of(std::array<std::uint32_t, 1>{0u}), 0x68AA0A89u);
  EXPECT_EQ(check_of(std::array<std::uint32_t, 2>{1u, 0u}) ^ check_of(std::array<std::uint32_t, 2>{0u, 0u}),
            32u);
  const KeptTick nothing;
  EXPECT_EQ(nothing.tick, 0u);
  EXPECT_EQ(nothing.faults, 0u);
  EXPECT_EQ(nothing.heat.pending_ticks, 0u);
}

TEST(KeptTick, MemoryThatCameUpByItselfIsNone) {
  for (const std::uint32_t word : {0u, 0xFFFFFFFFu, 0xAAAAAAAAu}) {
    const std::vector<std::uint32_t> memory(kKeptWords, word);
    KeptTick tick;
    EXPECT_FALSE(recall(memory, tick)) << word;
  }
}

TEST(KeptTick, ABoardWithoutSuchMemoryKeepsNone) {
  keep(kSome, {});
  KeptTick tick;
  EXPECT_FALSE(recall({}, tick));
  // Nor one that has too little of it, which stays as it is.
  std::vector<std::uint32_t> little(kKeptWords - 1, 7);
  keep(kSome, little);
  EXPECT_EQ(little, std::vector<std::uint32_t>(kKeptWords - 1, 7));
  EXPECT_FALSE(recall(little, tick));
}

}  // namespace
}  // namespace palpate::firmware
