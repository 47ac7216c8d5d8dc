#include "shared/math/dot16.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace palpate {
namespace {

constexpr std::size_t kLongest = 193;

TEST(Dot16, IsExactAtTheExtremesAndForOddLengths) {
  std::array<std::int16_t, 3 * kLongest> rows{};
  std::array<std::int16_t, kLongest> b{};
  rows.fill(-32768);
  b.fill(-32768);
  for (const std::int64_t sum : dot16_rows(rows.data(), b.data(), kLongest)) EXPECT_EQ(sum, 193LL << 30);
  for (const std::int64_t sum : dot16_rows(rows.data(), b.data(), 0)) EXPECT_EQ(sum, 0);
  std::mt19937 random(4);
  std::uniform_int_distribution<int> uniform(-32768, 32767);
  for (std::size_t count = 0; count <= kLongest; ++count) {
    for (std::int16_t& entry : rows) entry = static_cast<std::int16_t>(uniform(random));
    for (std::int16_t& entry : b) entry = static_cast<std::int16_t>(uniform(random));
    std::array<std::int64_t, 3> expected{};
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t i = 0; i < count; ++i)
        expected[row] += static_cast<std::int64_t>(rows[row * count + i]) * b[i];
    EXPECT_EQ(dot16_rows(rows.data(), b.data(), count), expected);
  }
}

}  // namespace
}  // namespace palpate
