#include "host/linearize/body_response.hpp"

#include <Eigen/CholmodSupport>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <cmath>
#include <complex>
#include <stdexcept>
#include <string>

#include "host/linearize/blas_lock.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Cholesky = Eigen::CholmodSupernodalLLT<Sparse, Eigen::Lower>;

// Relative error of a compliance that ends the iteration.
constexpr double kSolved = 1e-6;
// Rounds for one frequency; a damped body needs 3 to 6.
constexpr int kRounds = 40;
// Directions shorter than this part of what they were before others were taken out of them are rounding.
constexpr double kNewDirection = 1e-10;

std::size_t at(Eigen::Index i) {
  return static_cast<std::size_t>(i);
}

}  // namespace

// In mass-normalized displacements: M is the identity.
struct BodyResponse::Solver {
  Eigen::VectorXd root_mass;
  Sparse stiffness, damping;            // at the state
  Sparse rest_stiffness, rest_damping;  // at rest
  Cholesky factor;
  double factored_rad_s = -1.0;
  Eigen::MatrixXd force;                           // degrees of freedom x (3 points)
  Eigen::MatrixXd span, on_stiffness, on_damping;  // V, K V, B V
  Eigen::MatrixXd seen_stiffness, seen_damping;    // V' K V, V' B V

  void widen(const Eigen::MatrixXd& directions);
  Eigen::MatrixXd precondition(const Eigen::MatrixXd& residual, double w);
  [[nodiscard]] Eigen::Index points() const { return force.cols() / 3; }
};

void BodyResponse::Solver::widen(const Eigen::MatrixXd& directions) {
  Eigen::MatrixXd fresh = directions;
  fresh.colwise().normalize();
  // Twice each: what rounding leaves of other directions in a short rest is as large as the rest.
  for (int pass = 0; pass < 2; ++pass) {
    fresh -= span * (span.transpose() * fresh);
    for (auto column : fresh.colwise()) {
      const double length = column.norm();
      if (length > kNewDirection)
        column /= length;
      else
        column.setZero();
    }
  }
  for (int pass = 0; pass < 2; ++pass) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(fresh.transpose() * fresh);
    const Eigen::VectorXd& squared = gram.eigenvalues();
    const auto kept = (squared.array() > kNewDirection).count();
    if (kept == 0) return;
    fresh = (fresh * gram.eigenvectors().rightCols(kept) *
             squared.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal())
                .eval();
    fresh -= span * (span.transpose() * fresh);
  }
  const Eigen::Index kept = fresh.cols();

  const Eigen::Index old = span.cols(), all = old + kept;
  const auto append = [&](Eigen::MatrixXd& matrix, const Eigen::MatrixXd& columns) {
    matrix.conservativeResize(columns.rows(), all);
    matrix.rightCols(kept) = columns;
  };
  append(span, fresh);
  append(on_stiffness, stiffness * fresh);
  append(on_damping, damping * fresh);
  const auto see = [&](Eigen::MatrixXd& seen, const Eigen::MatrixXd& on) {
    seen.conservativeResize(all, all);
    seen.rightCols(kept) = span.transpose() * on.rightCols(kept);
    seen.bottomLeftCorner(kept, old) = fresh.transpose() * on.leftCols(old);
  };
  see(seen_stiffness, on_stiffness);
  see(seen_damping, on_damping);
}

Eigen::MatrixXd BodyResponse::Solver::precondition(const Eigen::MatrixXd& residual, double w) {
  const auto lock = blas_lock();
  if (factored_rad_s != w) {
    Sparse identity(stiffness.rows(), stiffness.cols());
    identity.setIdentity();
    const Sparse shifted = rest_stiffness + w * rest_damping + w * w * identity;
    factor.factorize(shifted);
    if (factor.info() != Eigen::Success)
      throw std::invalid_argument(
          "the body has a motion that no spring resists: it has no static answer to a force");
    factored_rad_s = w;
  }
  return factor.solve(residual);
}

BodyResponse::BodyResponse(const Body& body, const BodyState& state, std::vector<SurfacePoint> points)
    : solver_(std::make_unique<Solver>()) {
  if (body.planar() || points.empty())
    throw std::invalid_argument("a response needs a body with a surface and at least one point of it");
  Solver& s = *solver_;
  s.root_mass.resize(body.dof_count());
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) s.root_mass[dof] = std::sqrt(body.mass_kg(node));
  const auto scale = s.root_mass.cwiseInverse().asDiagonal();
  const Tangent now = tangent(body, state);
  s.stiffness = scale * Sparse(-now.df_dx_N_m) * scale;
  s.damping = scale * Sparse(-now.df_dv_N_s_m) * scale;
  const Tangent rest = tangent(body, body.rest_state());
  s.rest_stiffness = scale * Sparse(-rest.df_dx_N_m) * scale;
  s.rest_damping = scale * Sparse(-rest.df_dv_N_s_m) * scale;
  {
    const auto lock = blas_lock();
    s.factor.analyzePattern(s.rest_stiffness);
  }
  s.force = Eigen::MatrixXd::Zero(body.dof_count(), 3 * std::ssize(points));
  for (std::size_t p = 0; p < points.size(); ++p)
    for (int corner = 0; corner < 3; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        if (const int dof = body.dof(body.triangles()[at(points[p].triangle)][at(corner)], axis); dof >= 0)
          s.force(dof, static_cast<Eigen::Index>(3 * p) + axis) +=
              points[p].barycentric[corner] / s.root_mass[dof];
  s.span.resize(body.dof_count(), 0);
}

BodyResponse::~BodyResponse() = default;

std::vector<Eigen::Matrix3cd> BodyResponse::compliance(double frequency_rad_s) {
  Solver& s = *solver_;
  const double w = frequency_rad_s;
  const std::complex<double> iw(0.0, w);
  if (s.span.cols() == 0) s.widen(s.precondition(s.force, w));
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::Index n = s.span.cols();
    const Eigen::MatrixXcd dynamic =
        s.seen_stiffness + iw * s.seen_damping - w * w * Eigen::MatrixXcd::Identity(n, n);
    const Eigen::MatrixXcd seen = s.span.transpose() * s.force;
    const Eigen::MatrixXcd c = dynamic.partialPivLu().solve(seen);
    // Real and imaginary parts apart: real products.
    const Eigen::MatrixXd c_re = c.real(), c_im = c.imag();
    const Eigen::MatrixXd x_re = s.span * c_re, x_im = s.span * c_im;
    const Eigen::MatrixXd r_re = s.force - s.on_stiffness * c_re + w * (s.on_damping * c_im) + w * w * x_re;
    const Eigen::MatrixXd r_im = -s.on_stiffness * c_im - w * (s.on_damping * c_re) + w * w * x_im;

    std::vector<Eigen::Matrix3cd> result;
    bool solved = true;
    for (Eigen::Index p = 0; p < s.points(); ++p) {
      const auto columns = Eigen::seqN(3 * p, 3);
      result.emplace_back(s.force(Eigen::all, columns).transpose() * x_re(Eigen::all, columns) +
                          std::complex<double>(0, 1) *
                              (s.force(Eigen::all, columns).transpose() * x_im(Eigen::all, columns)));
      const double moved = std::hypot(x_re(Eigen::all, columns).norm(), x_im(Eigen::all, columns).norm());
      const double rest = std::hypot(r_re(Eigen::all, columns).norm(), r_im(Eigen::all, columns).norm());
      solved = solved && moved * rest <= kSolved * result.back().norm();
    }
    if (solved) return result;
    Eigen::MatrixXd residual(r_re.rows(), 2 * r_re.cols());
    residual << r_re, r_im;
    s.widen(s.precondition(residual, w));
    if (s.span.cols() == n) break;
  }
  throw std::runtime_error("the full body's answer at " + std::to_string(w / 6.283185307179586) +
                           " Hz does not converge; a body needs damping there");
}

}  // namespace palpate::host
