// From a linear second-order system to independent modes.
#pragma once

#include <Eigen/Core>

namespace palpate::host {

// M x'' + D x' + K x = f in modes: x = Phi q with Phi' M Phi = I, Phi' K Phi = diag(lambda), and modal force
// Phi' f.
struct ModalBasis {
  Eigen::VectorXd lambda_rad2_s2;   // ascending
  Eigen::VectorXd damping_rad_s;    // diagonal of Phi' D Phi
  Eigen::MatrixXd basis_1_sqrt_kg;  // Phi: degrees of freedom x modes
  Eigen::MatrixXd damping_1_s;      // Phi' D Phi, whole
  // What was neglected, each relative to the whole in the Frobenius norm: 0 where nothing was.
  double damping_coupling =
      0;  // off-diagonal part of Phi' D Phi; 0 for a body at rest with equal b / k throughout
  double stiffness_asymmetry = 0;  // antisymmetric part of K, from dampers in motion
};

// Keeps every mode. K is symmetrized. Throws std::invalid_argument for sizes that do not match, masses that
// are not positive, or numbers that are not finite. A system without degrees of freedom has no modes.
ModalBasis reduce_to_modes(const Eigen::MatrixXd& stiffness_N_m, const Eigen::MatrixXd& damping_N_s_m,
                           const Eigen::VectorXd& mass_kg);

}  // namespace palpate::host
