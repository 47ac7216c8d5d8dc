#include "host/reference/paper_operators.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <stdexcept>

#include "host/reference/test_patches.hpp"

namespace palpate::host::paper {
namespace {

constexpr int kNodes = 5;
constexpr int kCases = 1000;
// T's condition number is 1 / |(alpha, beta, gamma)| <= sqrt(3); sums of up to 15 products, three factors.
constexpr double kTolerance = 200 * std::numeric_limits<double>::epsilon();

ContactPoint random_point(test::Random& random) {
  std::array<int, kNodes> order{0, 1, 2, 3, 4};
  std::shuffle(order.begin(), order.end(), random.engine());
  return {{order[0], order[1], order[2]}, random.barycentric()};
}

Eigen::Vector3d random_normal(test::Random& random) {
  return random.vector(3, 1.0).normalized();
}

// The 3m x 3 matrix W with W' x = p.
Eigen::MatrixXd weights(const ContactPoint& point) {
  Eigen::MatrixXd w = Eigen::MatrixXd::Zero(3 * kNodes, 3);
  for (std::size_t k = 0; k < 3; ++k)
    w.block<3, 3>(3 * point.corner[k], 0) =
        point.barycentric[static_cast<Eigen::Index>(k)] * Eigen::Matrix3d::Identity();
  return w;
}

TEST(PaperOperators, TransformStartsWithTheContactPoint) {
  test::Random random(1);
  for (int i = 0; i < kCases; ++i) {
    const ContactPoint point = random_point(random);
    const Eigen::MatrixXd t = barycentric_transform(kNodes, point);
    const Eigen::VectorXd x = random.vector(3 * kNodes, 1.0);
    EXPECT_LT(((t * x).head<3>() - weights(point).transpose() * x).norm(), kTolerance);  // (9)
    // Orthogonal up to the length of the first rows.
    Eigen::MatrixXd gram = t * t.transpose();
    const double s = point.barycentric.squaredNorm();
    gram.topLeftCorner<3, 3>() /= s;
    EXPECT_LT((gram - Eigen::MatrixXd::Identity(3 * kNodes, 3 * kNodes)).norm(), kTolerance);
  }
}

TEST(PaperOperators, NormalTransformStartsWithTheNormalCoordinate) {
  test::Random random(2);
  for (int i = 0; i < kCases; ++i) {
    const ContactPoint point = random_point(random);
    const Eigen::Vector3d normal = random_normal(random);
    const Eigen::Matrix3d u0 = normal_block(normal);
    EXPECT_LT((u0 * u0.transpose() - Eigen::Matrix3d::Identity()).norm(), kTolerance);
    EXPECT_LT((u0.row(0).transpose() - normal).norm(), kTolerance);
    const Eigen::VectorXd x = random.vector(3 * kNodes, 1.0);
    EXPECT_NEAR((normal_transform(kNodes, point, normal) * x)[0], normal.dot(weights(point).transpose() * x),
                kTolerance);
  }
}

TEST(PaperOperators, ProjectionsAreThoseOfTheClosedForm) {
  test::Random random(3);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(3 * kNodes, 3 * kNodes);
  for (int i = 0; i < kCases; ++i) {
    const ContactPoint point = random_point(random);
    const Eigen::Vector3d normal = random_normal(random);
    const Eigen::MatrixXd w = weights(point);
    const double s = point.barycentric.squaredNorm();
    const Eigen::MatrixXd along_point = w * w.transpose() / s;
    const Eigen::MatrixXd along_normal = w * normal * normal.transpose() * w.transpose() / s;
    const Eigen::MatrixXd t = barycentric_transform(kNodes, point);
    const Eigen::MatrixXd u = normal_transform(kNodes, point, normal);
    EXPECT_LT((velocity_projection(t, 3) - (identity - along_point)).norm(), kTolerance);
    EXPECT_LT((force_projection(t, 3) - along_point).norm(), kTolerance);
    EXPECT_LT((velocity_projection(u, 1) - (identity - along_normal)).norm(), kTolerance);
    EXPECT_LT((force_projection(u, 1) - along_normal).norm(), kTolerance);
  }
}

// "The reciprocal nature of the nodal velocities and the nodal forces": P = T^-1 N T and P~ = T' (I - N)
// T'^-1 give P~ = (I - P)', so that the constraint's forces do no work on the velocities it leaves.
TEST(PaperOperators, ConstraintForcesDoNoWorkOnWhatIsLeft) {
  test::Random random(4);
  for (int i = 0; i < kCases; ++i) {
    const ContactPoint point = random_point(random);
    const Eigen::MatrixXd t = barycentric_transform(kNodes, point);
    const Eigen::VectorXd v = velocity_projection(t, 3) * random.vector(3 * kNodes, 1.0);
    const Eigen::VectorXd f = force_projection(t, 3) * random.vector(3 * kNodes, 1.0);
    EXPECT_NEAR(f.dot(v), 0.0, kTolerance * 3 * kNodes);
    EXPECT_LT((weights(point).transpose() * v).norm(), kTolerance);  // (6)
  }
}

TEST(PaperOperators, AContactAtACornerMovesThatNodeAlone) {
  const ContactPoint point{{3, 1, 4}, {0, 1, 0}};
  const Eigen::MatrixXd p_tilde = force_projection(barycentric_transform(kNodes, point), 3);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(3 * kNodes, 3 * kNodes);
  expected.block<3, 3>(3, 3).setIdentity();
  EXPECT_LT((p_tilde - expected).norm(), kTolerance);
}

TEST(PaperOperators, DependentRowsAreRefused) {
  Eigen::MatrixXd rows(2, 3);
  rows << 1, 2, 3, 2, 4, 6;
  EXPECT_THROW(complete_by_gram_schmidt(rows), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host::paper
