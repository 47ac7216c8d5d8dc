#include "host/reference/linear_patch.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <stdexcept>

#include "host/msd/forces.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host::paper {

Eigen::VectorXd LinearPatch::force_N(const Eigen::VectorXd& x_m, const Eigen::VectorXd& v_m_s) const {
  return rest_force_N + df_dx_N_m * (x_m - rest_position_m) + df_dv_N_s_m * (v_m_s - rest_velocity_m_s);
}

LinearPatch linear_patch(const Body& body, const BodyState& state, const SurfacePoint& contact,
                         const PatchSize& size) {
  if (body.axes().size() != 3)
    throw std::invalid_argument("the paper's contact needs a body with three axes, this one is planar");
  const std::vector<int> nodes = select_patch(body, contact, size);
  const SubsetTangent tangent = subset_tangent(body, state, nodes);
  LinearPatch patch;
  std::map<int, int> index;
  for (std::size_t d = 0; d < tangent.node.size(); d += 3) {
    index[tangent.node[d]] = static_cast<int>(patch.node.size());
    patch.node.push_back(tangent.node[d]);
  }
  const SubsetSurface surface = subset_surface(body, nodes, contact, static_cast<int>(nodes.size()));
  for (const auto& triangle : surface.corner) {
    std::array<int, 3> corner{};
    bool free = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto found = index.find(surface.node[static_cast<std::size_t>(triangle[k])]);
      free = free && found != index.end();
      if (free) corner[k] = found->second;
    }
    if (free) patch.corner.push_back(corner);
  }
  if (patch.corner.empty())
    throw std::invalid_argument("the patch has no triangle of which all corners can move");
  const auto dofs = static_cast<Eigen::Index>(tangent.node.size());
  patch.mass_kg = tangent.mass_kg;
  patch.df_dx_N_m = tangent.df_dx_N_m;
  patch.df_dv_N_s_m = tangent.df_dv_N_s_m;
  patch.rest_position_m.resize(dofs);
  patch.rest_velocity_m_s.resize(dofs);
  patch.rest_force_N.resize(dofs);
  for (std::size_t n = 0; n < patch.node.size(); ++n) {
    const auto row = static_cast<Eigen::Index>(3 * n);
    patch.rest_position_m.segment<3>(row) = state.position_m.col(patch.node[n]);
    patch.rest_velocity_m_s.segment<3>(row) = state.velocity_m_s.col(patch.node[n]);
    patch.rest_force_N.segment<3>(row) = nodal_force_N(body, state, patch.node[n]);
  }
  return patch;
}

double largest_stable_step_s(const LinearPatch& patch) {
  const Eigen::Index n = patch.mass_kg.size();
  const Eigen::VectorXd inverse_mass = patch.mass_kg.cwiseInverse();
  Eigen::MatrixXd generator = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  generator.topRightCorner(n, n).setIdentity();
  generator.bottomLeftCorner(n, n) = inverse_mass.asDiagonal() * patch.df_dx_N_m;
  generator.bottomRightCorner(n, n) = inverse_mass.asDiagonal() * patch.df_dv_N_s_m;
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(generator, false);
  if (solver.info() != Eigen::Success)
    throw std::runtime_error("the eigenproblem of the patch did not converge");

  // Explicit Euler: |1 + h z|^2 = 1 + 2 h Re z + h^2 |z|^2 <= 1. A motion that nothing acts on (z = 0) is
  // exact.
  const double largest = solver.eigenvalues().cwiseAbs().maxCoeff();
  constexpr double kZero = 1e-12;  // of the largest eigenvalue: rounding of the solver
  double step_s = std::numeric_limits<double>::infinity();
  for (const std::complex<double>& z : solver.eigenvalues()) {
    if (std::abs(z) <= kZero * largest) continue;
    step_s = std::min(step_s, std::max(0.0, -2.0 * z.real() - kZero * largest) / std::norm(z));
  }
  // Euler with the new velocity is stable where h^2 k + 2 h d < 4 m for every mode
  // (host/msd/stable_step.hpp).
  const Eigen::VectorXd root = inverse_mass.cwiseSqrt();
  const auto largest_of = [&root](const Eigen::MatrixXd& a) {
    const Eigen::MatrixXd scaled = -0.5 * (root.asDiagonal() * (a + a.transpose()) * root.asDiagonal());
    return std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly)
                             .eigenvalues()
                             .maxCoeff());
  };
  const double stiffness = largest_of(patch.df_dx_N_m), damping = largest_of(patch.df_dv_N_s_m);
  const double denominator = damping + std::sqrt(damping * damping + 4.0 * stiffness);
  if (denominator > 0) step_s = std::min(step_s, 4.0 / denominator);
  return step_s;
}

}  // namespace palpate::host::paper
