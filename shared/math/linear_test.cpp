#include "shared/math/linear.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

TEST(Linear, SolveInvertsMultiplication) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int trial = 0; trial < 1000; ++trial) {
    Mat3d a = Mat3d::identity(4.0);  // diagonally dominant, so well conditioned
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) a(r, c) += uniform(random);
    const Vec3d x{uniform(random), uniform(random), uniform(random)};
    Vec3d solved;
    ASSERT_TRUE(solve(a, a * x, solved));
    EXPECT_LT(norm(solved - x), 1e-13);
  }
}

TEST(Linear, SolveRefusesSingularMatrix) {
  Mat3d a{{{1, 2, 3}, {2, 4, 6}, {0, 0, 1}}};
  Vec3d x{7, 8, 9};
  EXPECT_FALSE(solve(a, Vec3d{1, 1, 1}, x));
  EXPECT_EQ(x, (Vec3d{7, 8, 9}));
}

TEST(Linear, NormalizedZeroIsZero) {
  EXPECT_EQ(normalized(Vec3f{}), Vec3f{});
}

TEST(Linear, DeterminantOfTransposeIsTheSame) {
  const Mat3d a{{{1, 2, 3}, {-2, 4, 6}, {5, 0, 1}}};
  EXPECT_DOUBLE_EQ(determinant(a), determinant(transpose(a)));
}

}  // namespace
}  // namespace palpate
