// What forces, momenta or displacements of the whole body are to a basis: Phi' e.
#pragma once

#include <Eigen/Core>

namespace palpate::host {

// Phi' E, modes x columns, for Phi: degrees of freedom x modes and E: degrees of freedom x columns. Sums are
// in double precision, in a fixed order: the same bits on every processor of an architecture. Phi is read
// once for two columns of E; reading it is most of the time, since it does not fit the nearer caches.
Eigen::MatrixXd project(const Eigen::MatrixXf& basis, const Eigen::MatrixXd& excitation);

}  // namespace palpate::host
