#include "shared/math/dot16.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

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

TEST(Dot16, ColumnsAreExactForAnyCountAndUpToTheirBound) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> uniform(-32768, 32767), small(-600, 600);
  constexpr std::size_t kRows = 96;
  std::vector<std::int16_t> matrix(kRows * kLongest);
  std::array<Row16, kRows> rows{};
  for (std::size_t columns : {std::size_t{0}, std::size_t{1}, std::size_t{8}, std::size_t{15}, kLongest}) {
    for (std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{95}, kRows}) {
      for (auto& entry : matrix) entry = static_cast<std::int16_t>(uniform(random));
      for (std::size_t r = 0; r < count; ++r)  // not in order
        rows[r] = {static_cast<std::uint16_t>(kRows - 1 - r), static_cast<std::int16_t>(small(random))};
      std::size_t taken = 0;
      dot16_columns(matrix.data(), columns, rows.data(), count, [&](std::size_t c, std::int32_t sum) {
        std::int64_t expected = 0;
        for (std::size_t r = 0; r < count; ++r)
          expected += std::int64_t{matrix[rows[r].row * columns + c]} * rows[r].factor;
        EXPECT_EQ(sum, expected);
        ++taken;
      });
      EXPECT_EQ(taken, columns);
    }
  }
  // Factors whose magnitudes add up to 65,535, on the largest entries.
  std::fill(matrix.begin(), matrix.end(), std::int16_t{-32768});
  rows[0] = {0, 32767};
  rows[1] = {1, -32768};
  std::fill(matrix.begin() + 9, matrix.begin() + 18, std::int16_t{32767});
  dot16_columns(matrix.data(), 9, rows.data(), 2,
                [](std::size_t, std::int32_t sum) { EXPECT_EQ(sum, -32768LL * 32767 - 32767LL * 32768); });
}

}  // namespace
}  // namespace palpate
