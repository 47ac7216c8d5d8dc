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

TEST(Dot16, ColumnsAreExactForAnyCountAndUpToTheirBound) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> uniform(-32768, 32767), small(-600, 600);
  std::array<std::array<std::int16_t, kLongest>, 96> matrix{};
  std::array<Row16, 96> rows{};
  for (std::size_t columns : {std::size_t{0}, std::size_t{1}, std::size_t{8}, std::size_t{15}, kLongest}) {
    for (std::size_t count :
         {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{95}, std::size_t{96}}) {
      for (std::size_t r = 0; r < count; ++r) {
        for (auto& entry : matrix[r]) entry = static_cast<std::int16_t>(uniform(random));
        rows[r] = {matrix[r].data(), small(random)};
      }
      std::size_t taken = 0;
      dot16_columns(rows.data(), count, columns, [&](std::size_t c, std::int32_t sum) {
        std::int64_t expected = 0;
        for (std::size_t r = 0; r < count; ++r) expected += std::int64_t{matrix[r][c]} * rows[r].factor;
        EXPECT_EQ(sum, expected);
        ++taken;
      });
      EXPECT_EQ(taken, columns);
    }
  }
  // Factors whose magnitudes add up to 65,535, on the largest entries.
  matrix[0].fill(-32768);
  matrix[1].fill(-32768);
  rows[0] = {matrix[0].data(), 32767};
  rows[1] = {matrix[1].data(), 32768};
  dot16_columns(rows.data(), 2, 9, [](std::size_t, std::int32_t sum) { EXPECT_EQ(sum, -32768LL * 65535); });
}

}  // namespace
}  // namespace palpate
