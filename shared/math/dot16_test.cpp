#include "shared/math/dot16.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace palpate {
namespace {

TEST(Dot16, IsExactAtTheExtremesAndForOddLengths) {
  std::array<std::int16_t, 193> a{}, b{};
  a.fill(-32768);
  b.fill(-32768);
  EXPECT_EQ(dot16(a.data(), b.data(), a.size()), 193LL << 30);
  EXPECT_EQ(dot16(a.data(), b.data(), 0), 0);
  std::mt19937 random(4);
  std::uniform_int_distribution<int> uniform(-32768, 32767);
  for (std::size_t count = 0; count <= a.size(); ++count) {
    std::int64_t expected = 0;
    for (std::size_t i = 0; i < count; ++i) {
      a[i] = static_cast<std::int16_t>(uniform(random));
      b[i] = static_cast<std::int16_t>(uniform(random));
      expected += static_cast<std::int64_t>(a[i]) * b[i];
    }
    EXPECT_EQ(dot16(a.data(), b.data(), count), expected);
  }
}

}  // namespace
}  // namespace palpate
