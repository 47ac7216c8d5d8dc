#include "host/reference/paper_operators.hpp"

#include <Eigen/LU>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace palpate::host::paper {

Eigen::MatrixXd complete_by_gram_schmidt(const Eigen::MatrixXd& first_rows) {
  const Eigen::Index n = first_rows.cols(), given = first_rows.rows();
  Eigen::MatrixXd result(n, n);
  Eigen::MatrixXd unit(n, n);  // the same rows, of unit length and orthogonal
  const auto remainder = [&unit](Eigen::VectorXd v, Eigen::Index rows) {
    for (int pass = 0; pass < 2; ++pass)
      v -= (unit.topRows(rows).transpose() * (unit.topRows(rows) * v)).eval();
    return v;
  };
  constexpr double kDependent = 1e-12;  // of a row's length
  for (Eigen::Index r = 0; r < given; ++r) {
    const Eigen::VectorXd row = first_rows.row(r).transpose();
    const Eigen::VectorXd rest = remainder(row, r);
    if (!(rest.norm() > kDependent * row.norm()))
      throw std::invalid_argument("row " + std::to_string(r) + " depends on the rows before it");
    result.row(r) = row.transpose();
    unit.row(r) = rest.normalized().transpose();
  }
  for (Eigen::Index r = given; r < n; ++r) {
    Eigen::VectorXd best = Eigen::VectorXd::Zero(n);
    for (Eigen::Index candidate = 0; candidate < n; ++candidate) {
      const Eigen::VectorXd rest = remainder(Eigen::VectorXd::Unit(n, candidate), r);
      if (rest.norm() > best.norm()) best = rest;
    }
    unit.row(r) = best.normalized().transpose();
    result.row(r) = unit.row(r);
  }
  return result;
}

Eigen::MatrixXd barycentric_block(const Eigen::Vector3d& barycentric) {
  Eigen::MatrixXd first(3, 9);
  for (Eigen::Index k = 0; k < 3; ++k)
    first.middleCols<3>(3 * k) = barycentric[k] * Eigen::Matrix3d::Identity();
  return complete_by_gram_schmidt(first);
}

Eigen::MatrixXd barycentric_transform(int nodes, const ContactPoint& point) {
  Eigen::MatrixXd permutation = Eigen::MatrixXd::Zero(3 * nodes, 3 * nodes);
  Eigen::Index row = 0;
  const auto append = [&](int node) {
    permutation.block<3, 3>(row, 3 * node).setIdentity();
    row += 3;
  };
  for (const int node : point.corner) append(node);
  for (int node = 0; node < nodes; ++node)
    if (node != point.corner[0] && node != point.corner[1] && node != point.corner[2]) append(node);
  Eigen::MatrixXd t = Eigen::MatrixXd::Identity(3 * nodes, 3 * nodes);
  t.topLeftCorner<9, 9>() = barycentric_block(point.barycentric);
  return t * permutation;
}

Eigen::Matrix3d normal_block(const Eigen::Vector3d& normal) {
  return complete_by_gram_schmidt(normal.transpose());
}

Eigen::MatrixXd normal_transform(int nodes, const ContactPoint& point, const Eigen::Vector3d& normal) {
  Eigen::MatrixXd u = Eigen::MatrixXd::Identity(3 * nodes, 3 * nodes);
  u.topLeftCorner<3, 3>() = normal_block(normal);
  return u * barycentric_transform(nodes, point);
}

Eigen::MatrixXd velocity_projection(const Eigen::MatrixXd& transform, int constrained) {
  Eigen::MatrixXd keep = Eigen::MatrixXd::Identity(transform.rows(), transform.cols());
  keep.topLeftCorner(constrained, constrained).setZero();
  return transform.inverse() * keep * transform;
}

Eigen::MatrixXd force_projection(const Eigen::MatrixXd& transform, int constrained) {
  Eigen::MatrixXd keep = Eigen::MatrixXd::Zero(transform.rows(), transform.cols());
  keep.topLeftCorner(constrained, constrained).setIdentity();
  return transform.transpose() * keep * transform.transpose().inverse();
}

}  // namespace palpate::host::paper
