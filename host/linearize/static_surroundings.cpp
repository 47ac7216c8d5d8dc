#include "host/linearize/static_surroundings.hpp"

#include <Eigen/Cholesky>
#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "host/linearize/blas_lock.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Halvings of the interval of a spring factor: to 1e-9.
constexpr int kHalvings = 30;

std::vector<int> dofs_of(const Body& body, const SubsetTangent& subset) {
  std::vector<int> dofs;
  dofs.reserve(subset.node.size());
  for (std::size_t d = 0; d < subset.node.size(); ++d)
    dofs.push_back(body.dof(subset.node[d], subset.axis[d]));
  return dofs;
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& positive) {
  return positive.llt().solve(Eigen::MatrixXd::Identity(positive.rows(), positive.cols()));
}

}  // namespace

struct StaticSurroundings::Factor {
  Eigen::CholmodSupernodalLLT<Sparse, Eigen::Lower> stiffness;
};

StaticSurroundings::StaticSurroundings(const Body& body) : body_(body), factor_(std::make_unique<Factor>()) {
  const Sparse stiffness_N_m = -tangent(body, body.rest_state()).df_dx_N_m;
  const auto lock = blas_lock();
  factor_->stiffness.compute(stiffness_N_m);
  if (factor_->stiffness.info() != Eigen::Success)
    throw std::invalid_argument(
        "the body has a motion that no spring resists: it has no static answer to a force");
}

StaticSurroundings::~StaticSurroundings() = default;

Eigen::MatrixXd StaticSurroundings::compliance_m_N(const std::vector<int>& nodes) const {
  const std::vector<int> dofs = dofs_of(body_, subset_tangent(body_, body_.rest_state(), nodes));
  const auto count = std::ssize(dofs);
  if (count == 0) return {};
  Eigen::MatrixXd force = Eigen::MatrixXd::Zero(body_.dof_count(), count);
  for (Eigen::Index d = 0; d < count; ++d) force(dofs[static_cast<std::size_t>(d)], d) = 1.0;
  const Eigen::MatrixXd moved = [&]() -> Eigen::MatrixXd {
    const auto lock = blas_lock();
    return factor_->stiffness.solve(force);
  }();
  const Eigen::MatrixXd own = moved(dofs, Eigen::all);
  return 0.5 * (own + own.transpose());
}

Eigen::MatrixXd StaticSurroundings::softening_N_m(const std::vector<int>& nodes) const {
  // The Schur complement is the inverse of the nodes' block of the inverse.
  const Eigen::MatrixXd held = -subset_tangent(body_, body_.rest_state(), nodes).df_dx_N_m;
  if (held.size() == 0) return {};
  return held - inverse(compliance_m_N(nodes));
}

double StaticSurroundings::spring_factor(const std::vector<int>& nodes) const {
  const BodyState rest = body_.rest_state();
  const Eigen::MatrixXd held = -subset_tangent(body_, rest, nodes).df_dx_N_m;
  const Eigen::MatrixXd cut = -subset_tangent(body_, rest, nodes, 0.0).df_dx_N_m;
  const Eigen::MatrixXd springs = held - cut;
  // Degrees of freedom at whose node such a spring ends: not zero in the difference.
  std::vector<Eigen::Index> border;
  for (Eigen::Index d = 0; d < springs.rows(); ++d)
    if (springs.row(d).cwiseAbs().maxCoeff() > 0) border.push_back(d);
  if (border.empty()) return 1.0;
  const double wanted = Eigen::VectorXd(compliance_m_N(nodes).diagonal()(border)).sum();
  double low = 0.0, high = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    const double yields = Eigen::VectorXd(inverse(cut + middle * springs).diagonal()(border)).sum();
    (yields > wanted ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace palpate::host
