// The tangent F = [df/dX df/dV] of the nodal forces: equation (3) of the paper.
//
// For a spring from i to j with separation d, length l, direction n = d / l, P = I - n n', relative velocity
// u:
//   force on i      = (k (l - L) + b u . n) n
//   d(force)/dd     = k n n' + (k (l - L) / l) P + (b / l) (n (P u)' + (u . n) P)
//   d(force)/du     = b n n'
// The second term is the geometric stiffness of a stretched spring; the third, of moving dampers, is not
// symmetric. Coincident nodes contribute nothing (spring.hpp). Weight is constant and does not enter.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "host/msd/body.hpp"

namespace palpate::host {

// Rows and columns are the body's degrees of freedom (Body::dof); fixed nodes are held.
struct Tangent {
  Eigen::SparseMatrix<double> df_dx_N_m;
  Eigen::SparseMatrix<double> df_dv_N_s_m;
};
Tangent tangent(const Body& body, const BodyState& state);

// The block of the tangent for some nodes, all others held. Degrees of freedom: the movable axes of the free
// nodes in the order given.
struct SubsetTangent {
  std::vector<int> node;  // of each degree of freedom
  std::vector<int> axis;
  Eigen::VectorXd mass_kg;
  Eigen::MatrixXd df_dx_N_m;
  Eigen::MatrixXd df_dv_N_s_m;
};
// Visits only the springs at these nodes. Throws std::invalid_argument for a node that does not exist or
// comes twice.
SubsetTangent subset_tangent(const Body& body, const BodyState& state, const std::vector<int>& nodes);

}  // namespace palpate::host
