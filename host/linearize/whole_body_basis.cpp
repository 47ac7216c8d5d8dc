#include "host/linearize/whole_body_basis.hpp"

#include <cblas.h>

#include <Eigen/CholmodSupport>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "host/linearize/blas_lock.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Cholesky = Eigen::CholmodSupernodalLLT<Sparse, Eigen::Lower>;
using RowMajor = Eigen::Matrix<double, -1, -1, Eigen::RowMajor>;

// Directions with less than this part of the largest one's squared length, all attachment modes being of
// length 1, say what others do: rounding is 1e-16.
constexpr double kNewDirection = 1e-13;

std::vector<int> dofs_of(const Body& body, const std::vector<int>& nodes) {
  std::vector<int> dofs;
  for (const int node : nodes)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) dofs.push_back(dof);
  return dofs;
}

// The tall products by BLAS, which CHOLMOD uses too: a quarter of the time of Eigen's, whose vectors are
// those of the oldest processor.
Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd c(a.rows(), b.cols());
  const auto rows = static_cast<int>(a.rows()), inner = static_cast<int>(a.cols()),
             columns = static_cast<int>(b.cols());
  const auto lock = blas_lock();
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, rows, columns, inner, 1.0, a.data(), rows, b.data(),
              inner, 0.0, c.data(), rows);
  return c;
}

// a' b.
Eigen::MatrixXd inner_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd c(a.cols(), b.cols());
  const auto rows = static_cast<int>(a.cols()), inner = static_cast<int>(a.rows()),
             columns = static_cast<int>(b.cols());
  const auto lock = blas_lock();
  cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, rows, columns, inner, 1.0, a.data(), inner, b.data(),
              inner, 0.0, c.data(), rows);
  return c;
}

Eigen::MatrixXd solved(const Cholesky& factor, const Eigen::MatrixXd& forces) {
  const auto lock = blas_lock();
  return factor.solve(forces);
}

// W with W' gram W = I for what is not rounding in gram.
Eigen::MatrixXd whitening(const Eigen::MatrixXd& gram) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  if (solver.info() != Eigen::Success)
    throw std::runtime_error("the eigenproblem of the attachment modes did not converge");
  const Eigen::VectorXd& length = solver.eigenvalues();
  const Eigen::Index all = length.size();
  const auto kept = (length.array() > kNewDirection * length[all - 1]).count();
  return solver.eigenvectors().rightCols(kept) * length.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

}  // namespace

void require_shifts(const Shifts& shifts) {
  if (shifts.all_rad_s.empty())
    throw std::invalid_argument("a reduction of the whole body needs a frequency");
  for (const std::vector<double>& list : {shifts.all_rad_s, shifts.middle_rad_s})
    for (std::size_t i = 0; i < list.size(); ++i)
      if (!std::isfinite(list[i]) || list[i] < (i == 0 ? 0.0 : list[i - 1] * (1.0 + 1e-6)))
        throw std::invalid_argument("frequency " + std::to_string(list[i]) +
                                    " rad/s, allowed: finite, not negative, ascending");
}

struct WholeBodyReduction::Factors {
  Eigen::VectorXd root_mass;
  Sparse stiffness, damping;                                     // mass-normalized
  std::vector<std::unique_ptr<Cholesky>> factor, middle_factor;  // of each frequency
};

WholeBodyReduction::WholeBodyReduction(const Body& body, const Shifts& shifts)
    : body_(body), factors_(std::make_unique<Factors>()) {
  require_shifts(shifts);
  Factors& f = *factors_;
  f.root_mass.resize(body.dof_count());
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) f.root_mass[dof] = std::sqrt(body.mass_kg(node));
  const Tangent tangent_at_rest = tangent(body, body.rest_state());
  const auto scale = f.root_mass.cwiseInverse().asDiagonal();
  f.stiffness = scale * Sparse(-tangent_at_rest.df_dx_N_m) * scale;
  f.damping = scale * Sparse(-tangent_at_rest.df_dv_N_s_m) * scale;
  Sparse identity(body.dof_count(), body.dof_count());
  identity.setIdentity();
  const auto factor = [&](double s) {
    auto result = std::make_unique<Cholesky>();
    // Nested dissection: of a lattice of 12 x 12 x 12 nodes the factor has a fifth less than by minimum
    // degree, of 20 x 20 x 20 two fifths.
    result->cholmod().nmethods = 1;
    result->cholmod().method[0].ordering = CHOLMOD_METIS;
    const Sparse shifted = f.stiffness + s * f.damping + s * s * identity;
    const auto lock = blas_lock();
    result->compute(shifted);
    if (result->info() != Eigen::Success)
      throw std::invalid_argument(
          "the body has a motion that no spring resists: it has no static answer to a force");
    return result;
  };
  for (const double s : shifts.all_rad_s) f.factor.push_back(factor(s));
  for (const double s : shifts.middle_rad_s) f.middle_factor.push_back(factor(s));
}

WholeBodyReduction::~WholeBodyReduction() = default;

WholeBodyBasis WholeBodyReduction::reduce(const std::vector<int>& nodes) const {
  const Factors& f = *factors_;
  const std::vector<int> ports = dofs_of(body_, nodes);
  const auto count = static_cast<Eigen::Index>(ports.size());
  const std::vector<int> middle(nodes.begin(),
                                nodes.begin() + std::min(std::ssize(nodes), std::ptrdiff_t{kMiddlePorts}));
  const auto middle_count = std::ssize(dofs_of(body_, middle));
  WholeBodyBasis reduced;
  if (count == 0) {
    reduced.basis_1_sqrt_kg.resize(body_.dof_count(), 0);
    return reduced;
  }
  Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(body_.dof_count(), count);
  for (Eigen::Index p = 0; p < count; ++p) forces(ports[static_cast<std::size_t>(p)], p) = 1.0;
  Eigen::MatrixXd answers(body_.dof_count(),
                          count * std::ssize(f.factor) + middle_count * std::ssize(f.middle_factor));
  Eigen::Index next = 0;
  for (const auto& factor : f.factor) {
    answers.middleCols(next, count) = solved(*factor, forces);
    next += count;
  }
  if (middle_count > 0) {
    const Eigen::MatrixXd middle_forces = forces.leftCols(middle_count);
    for (const auto& factor : f.middle_factor) {
      answers.middleCols(next, middle_count) = solved(*factor, middle_forces);
      next += middle_count;
    }
  }
  answers.colwise().normalize();

  // Twice: what rounding leaves of other directions in a short one is as large as that, and goes the second
  // time.
  const Eigen::MatrixXd once = product(answers, whitening(inner_product(answers, answers)));
  const Eigen::MatrixXd again = whitening(inner_product(once, once));
  const auto seen_from_span = [&](const Sparse& matrix) -> Eigen::MatrixXd {
    // A row of the span at a time, together in memory; the matrix is symmetric.
    const Eigen::MatrixXd applied = matrix.transpose() * RowMajor(once);
    return again.transpose() * inner_product(once, applied) * again;
  };
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(seen_from_span(f.stiffness));
  if (solver.info() != Eigen::Success)
    throw std::runtime_error("the eigenproblem of the reduced stiffness did not converge");
  reduced.damping_1_s = solver.eigenvectors().transpose() * seen_from_span(f.damping) * solver.eigenvectors();
  reduced.lambda_rad2_s2 = solver.eigenvalues();
  reduced.basis_1_sqrt_kg =
      f.root_mass.cwiseInverse().asDiagonal() * product(once, again * solver.eigenvectors());
  return reduced;
}

}  // namespace palpate::host
