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
// Visits only the springs at these nodes. outside: factor on the springs (and dampers) from them to free
// nodes that are not among them. Throws std::invalid_argument for a node that does not exist or comes twice.
SubsetTangent subset_tangent(const Body& body, const BodyState& state, const std::vector<int>& nodes,
                             double outside = 1.0);

// A spring whose tangent is not what it is at rest: what is added to -df_dx and -df_dv for the separation
// x_j - x_i.
struct TangentChange {
  int i = 0, j = 0;
  Eigen::Matrix3d stiffness_N_m = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d damping_N_s_m = Eigen::Matrix3d::Zero();
};

// Finds them. The body must outlive it.
class TangentChanges {
 public:
  explicit TangentChanges(const Body& body);

  // The springs whose stiffness or damping differs from that at rest by more than `tolerance` of the spring's
  // own, in the Frobenius norm, in the order of Body::springs. What is left out is at most that, in whatever
  // direction a spring is stretched. Replaces `changes`.
  void find(const BodyState& state, double tolerance, std::vector<TangentChange>& changes) const;

 private:
  const Body& body_;
  std::vector<TangentChange> rest_;  // the tangents at rest
};

}  // namespace palpate::host
