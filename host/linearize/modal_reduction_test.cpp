#include "host/linearize/modal_reduction.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace palpate::host {
namespace {

TEST(ModalReduction, DiagonalizesMassStiffnessAndProportionalDamping) {
  const Eigen::Index n = 12;
  Eigen::MatrixXd random = Eigen::MatrixXd::Random(n, n);
  const Eigen::MatrixXd k = 100.0 * (random * random.transpose() - 0.5 * Eigen::MatrixXd::Identity(n, n));
  const Eigen::VectorXd m = 0.001 * (Eigen::VectorXd::Random(n).array() + 2.0).matrix();
  const Eigen::MatrixXd d = 0.003 * k + 2.0 * Eigen::MatrixXd(m.asDiagonal());
  const ModalBasis modes = reduce_to_modes(k, d, m);
  const Eigen::MatrixXd& phi = modes.basis_1_sqrt_kg;
  EXPECT_LT((phi.transpose() * m.asDiagonal() * phi - Eigen::MatrixXd::Identity(n, n)).norm(), 1e-12);
  EXPECT_LT((phi.transpose() * k * phi - Eigen::MatrixXd(modes.lambda_rad2_s2.asDiagonal())).norm(),
            1e-12 * modes.lambda_rad2_s2.norm());
  EXPECT_LT((modes.damping_rad_s - (0.003 * modes.lambda_rad2_s2.array() + 2.0).matrix()).norm(),
            1e-12 * modes.damping_rad_s.norm());
  EXPECT_LT(modes.damping_coupling, 1e-13);
  EXPECT_EQ(modes.stiffness_asymmetry, 0.0);
  EXPECT_LT(modes.lambda_rad2_s2[0], 0.0);  // k is indefinite, and that is allowed
  for (Eigen::Index i = 0; i + 1 < n; ++i) EXPECT_LE(modes.lambda_rad2_s2[i], modes.lambda_rad2_s2[i + 1]);
}

TEST(ModalReduction, ReportsWhatItNeglects) {
  Eigen::Matrix2d k;
  k << 2, 3, 1, 2;  // symmetric part [2 2; 2 2], antisymmetric part [0 1; -1 0]
  const ModalBasis modes = reduce_to_modes(k, Eigen::Matrix2d::Zero(), Eigen::Vector2d::Ones());
  EXPECT_NEAR(modes.stiffness_asymmetry, std::sqrt(2.0 / 18.0), 1e-15);
  EXPECT_NEAR(modes.lambda_rad2_s2[1], 4.0, 1e-14);

  Eigen::Matrix2d d;
  d << 1, 1, 1, 2;
  const Eigen::Matrix2d uncoupled = Eigen::Vector2d(1, 5).asDiagonal();
  EXPECT_NEAR(reduce_to_modes(uncoupled, d, Eigen::Vector2d::Ones()).damping_coupling, std::sqrt(2.0 / 7.0),
              1e-15);
}

TEST(ModalReduction, HandlesAndRefusesTheEdges) {
  EXPECT_EQ(
      reduce_to_modes(Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 0), Eigen::VectorXd(0)).lambda_rad2_s2.size(),
      0);
  const Eigen::MatrixXd good = Eigen::MatrixXd::Identity(2, 2);
  EXPECT_THROW(reduce_to_modes(good, good, Eigen::VectorXd::Ones(3)), std::invalid_argument);
  EXPECT_THROW(reduce_to_modes(good, good, Eigen::Vector2d(1, 0)), std::invalid_argument);
  const Eigen::MatrixXd bad = good * std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(reduce_to_modes(good, bad, Eigen::VectorXd::Ones(2)), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
