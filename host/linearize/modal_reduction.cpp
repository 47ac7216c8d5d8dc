#include "host/linearize/modal_reduction.hpp"

#include <Eigen/Eigenvalues>
#include <stdexcept>
#include <string>

namespace palpate::host {
namespace {

double relative(double part, double whole) {
  return whole > 0 ? part / whole : 0.0;
}

void validate(const Eigen::MatrixXd& stiffness_N_m, const Eigen::MatrixXd& damping_N_s_m,
              const Eigen::VectorXd& mass_kg) {
  const Eigen::Index dofs = mass_kg.size();
  const auto square = [dofs](const Eigen::MatrixXd& a) { return a.rows() == dofs && a.cols() == dofs; };
  if (!square(stiffness_N_m) || !square(damping_N_s_m))
    throw std::invalid_argument("stiffness and damping must be square with " + std::to_string(dofs) +
                                " rows, as there are masses");
  if (!stiffness_N_m.allFinite() || !damping_N_s_m.allFinite() || !mass_kg.allFinite())
    throw std::invalid_argument("stiffness, damping or mass holds a number that is not finite");
  if (dofs > 0 && !(mass_kg.minCoeff() > 0))
    throw std::invalid_argument("mass_kg holds " + std::to_string(mass_kg.minCoeff()) +
                                ", allowed: positive");
}

}  // namespace

ModalBasis reduce_to_modes(const Eigen::MatrixXd& stiffness_N_m, const Eigen::MatrixXd& damping_N_s_m,
                           const Eigen::VectorXd& mass_kg) {
  validate(stiffness_N_m, damping_N_s_m, mass_kg);
  ModalBasis modes;
  const Eigen::Index dofs = mass_kg.size();
  if (dofs == 0) {
    modes.basis_1_sqrt_kg.resize(0, 0);
    modes.damping_1_s.resize(0, 0);
    return modes;
  }
  const Eigen::MatrixXd symmetric = 0.5 * (stiffness_N_m + stiffness_N_m.transpose());
  modes.stiffness_asymmetry = relative((stiffness_N_m - symmetric).norm(), stiffness_N_m.norm());

  // With a diagonal M, K phi = lambda M phi is the ordinary problem of M^-1/2 K M^-1/2.
  const Eigen::VectorXd inverse_root_mass = mass_kg.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = inverse_root_mass.asDiagonal() * symmetric * inverse_root_mass.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  if (solver.info() != Eigen::Success)
    throw std::runtime_error("the eigenproblem of the stiffness did not converge");
  modes.lambda_rad2_s2 = solver.eigenvalues();
  modes.basis_1_sqrt_kg = inverse_root_mass.asDiagonal() * solver.eigenvectors();

  modes.damping_1_s = modes.basis_1_sqrt_kg.transpose() * damping_N_s_m * modes.basis_1_sqrt_kg;
  modes.damping_rad_s = modes.damping_1_s.diagonal();
  const Eigen::MatrixXd coupling = modes.damping_1_s - Eigen::MatrixXd(modes.damping_rad_s.asDiagonal());
  modes.damping_coupling = relative(coupling.norm(), modes.damping_1_s.norm());
  return modes;
}

}  // namespace palpate::host
