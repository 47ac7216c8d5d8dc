// Nodal forces f(X, V) of the springs, their dampers and the weight: equation (1) of the paper without
// contact.
#pragma once

#include <Eigen/Core>

#include "host/msd/body.hpp"
#include "host/msd/spring_layout.hpp"
#include "host/msd/vectors.hpp"

namespace palpate::host {

// Evaluates all nodal forces of a body. Holds scratch memory (one object per thread) and no reference to the
// body.
class ForceEvaluator {
 public:
  explicit ForceEvaluator(const Body& body);

  // force_N (3 x nodes, device frame): springs, dampers and weight on every node. Fixed nodes get theirs as
  // well; it is what their support must hold. Coincident nodes exert no force on each other (spring.hpp).
  void evaluate(const BodyState& state, Eigen::Matrix3Xd& force_N);

  // The same for states stored axis by axis (nodes x 3).
  void evaluate(const NodalArray& position_m, const NodalArray& velocity_m_s, NodalArray& force_N) const;

 private:
  SpringLayout layout_;
  NodalArray weight_N_;
  NodalArray position_m_;
  NodalArray velocity_m_s_;
  NodalArray force_N_;
};

// The force on one node, from its own springs; equal to ForceEvaluator's to rounding.
Eigen::Vector3d nodal_force_N(const Body& body, const BodyState& state, int node);

// Views of the three columns for the kernels.
inline NodalView view(const NodalArray& a) {
  return {a.col(0).data(), a.col(1).data(), a.col(2).data()};
}
inline MutableNodalView mutable_view(NodalArray& a) {
  return {a.col(0).data(), a.col(1).data(), a.col(2).data()};
}

}  // namespace palpate::host
