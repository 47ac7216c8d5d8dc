// What it costs to leave out the off-diagonal modal damping: a bound on the error of the compliance.
//
// In modes M = I, K = diag(lambda), and Phi' B Phi = diag(d) + N; the board's modes have d alone. With
//   G = 1 / (lambda - w^2 + i w d)  (diagonal),   X = G phi',   phi the modes at the contact (3 x modes),
// the compliance is phi X, and with N it is phi H phi' with H = (1/G + i w N)^-1. Twice the identity
// H = G - i w G N H, once from either side:
//   phi H phi' - phi X = -i w X' N X - w^2 X' N H N X.
// With G = |G|^1/2 U |G|^1/2, U of modulus 1, H = |G|^1/2 (1/U + i E)^-1 |G|^1/2 where E = w |G|^1/2 N
// |G|^1/2 is symmetric. Because w |G| <= 1 / d, |E| <= eta = |d^-1/2 N d^-1/2|; for eta < 1 the middle is at
// most 1 / (1 - eta). So, in 2-norms, the error is at most
//   w |X' N X| + w^2 | |G|^1/2 N X |^2 / (1 - e),   e the less of eta and the Frobenius norm of E at w.
// Where e is 1 or more, or a mode has no damping of its own but coupling, there is no bound.
#pragma once

#include <Eigen/Core>

namespace palpate::host {

// eta of the above; 0 for damping that is diagonal, infinite where a coupled mode has d = 0. damping_1_s:
// Phi' B Phi, symmetric.
double damping_coupling_norm(const Eigen::MatrixXd& damping_1_s);

// The bound over the norm of the compliance of the uncoupled modes, phi X. Infinite where there is none. phi:
// 3 x modes, 1 / sqrt(kg). eta: damping_coupling_norm. w > 0.
double damping_error_bound(const Eigen::Matrix3Xd& phi, const Eigen::VectorXd& lambda_rad2_s2,
                           const Eigen::MatrixXd& damping_1_s, double eta, double frequency_rad_s);

// The error itself, the same way, from a dense solution.
double damping_error(const Eigen::Matrix3Xd& phi, const Eigen::VectorXd& lambda_rad2_s2,
                     const Eigen::MatrixXd& damping_1_s, double frequency_rad_s);

}  // namespace palpate::host
