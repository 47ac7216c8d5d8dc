#include "host/linearize/damping_error.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "host/linearize/compliance_error.hpp"

namespace palpate::host {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

Eigen::MatrixXd off_diagonal(Eigen::MatrixXd matrix) {
  matrix.diagonal().setZero();
  return matrix;
}

Eigen::ArrayXcd uncoupled(const Eigen::VectorXd& lambda_rad2_s2, const Eigen::MatrixXd& damping_1_s,
                          double w) {
  return (lambda_rad2_s2.array() - w * w + std::complex<double>(0, w) * damping_1_s.diagonal().array())
      .inverse();
}

}  // namespace

double damping_coupling_norm(const Eigen::MatrixXd& damping_1_s) {
  Eigen::MatrixXd scaled = off_diagonal(damping_1_s);
  for (Eigen::Index m = 0; m < scaled.rows(); ++m) {
    const double own = damping_1_s(m, m);
    if (!(own > 0) && !scaled.col(m).isZero(0.0)) return kNone;
    const double scale = own > 0 ? 1.0 / std::sqrt(own) : 0.0;
    scaled.col(m) *= scale;
    scaled.row(m) *= scale;
  }
  if (scaled.size() == 0) return 0.0;
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .cwiseAbs()
      .maxCoeff();
}

double damping_error_bound(const Eigen::Matrix3Xd& phi, const Eigen::VectorXd& lambda_rad2_s2,
                           const Eigen::MatrixXd& damping_1_s, double eta, double frequency_rad_s) {
  const double w = frequency_rad_s;
  const Eigen::MatrixXd coupling = off_diagonal(damping_1_s);
  const Eigen::ArrayXcd g = uncoupled(lambda_rad2_s2, damping_1_s, w);
  const Eigen::VectorXd root = g.abs().sqrt();
  const double at_w = w * (root.asDiagonal() * coupling * root.asDiagonal()).norm();
  const double e = std::min(eta, at_w);
  if (!(e < 1.0)) return kNone;
  const Eigen::MatrixXcd x = g.matrix().asDiagonal() * phi.transpose();
  const Eigen::MatrixXcd pushed = coupling * x;
  const double first = w * norm(x.transpose() * pushed);
  const Eigen::Matrix3cd squared = pushed.adjoint() * (root.cwiseAbs2().asDiagonal() * pushed);
  return (first + w * w * norm(squared) / (1.0 - e)) / norm(phi * x);
}

double damping_error(const Eigen::Matrix3Xd& phi, const Eigen::VectorXd& lambda_rad2_s2,
                     const Eigen::MatrixXd& damping_1_s, double frequency_rad_s) {
  const double w = frequency_rad_s;
  Eigen::MatrixXcd dynamic = std::complex<double>(0, w) * damping_1_s;
  dynamic.diagonal().array() += lambda_rad2_s2.array() - w * w;
  const Eigen::MatrixXcd force = phi.transpose().cast<std::complex<double>>();
  const Eigen::Matrix3cd coupled = phi * dynamic.partialPivLu().solve(force);
  const Eigen::Matrix3cd alone =
      phi * (uncoupled(lambda_rad2_s2, damping_1_s, w).matrix().asDiagonal() * force);
  return norm(coupled - alone) / norm(alone);
}

}  // namespace palpate::host
