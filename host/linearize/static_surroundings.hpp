// What the body around a few of its nodes does to them statically, at rest.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "host/msd/body.hpp"

namespace palpate::host {

// A factor of the body at rest, once. One object per thread. The body must outlive it.
class StaticSurroundings {
 public:
  // Throws std::invalid_argument for a body with a motion that no spring resists.
  explicit StaticSurroundings(const Body& body);
  ~StaticSurroundings();
  StaticSurroundings(const StaticSurroundings&) = delete;
  StaticSurroundings& operator=(const StaticSurroundings&) = delete;

  // In the degrees of freedom of subset_tangent(body, state, nodes), all other nodes without load:
  // their displacements under unit forces on them, m / N.
  [[nodiscard]] Eigen::MatrixXd compliance_m_N(const std::vector<int>& nodes) const;

  // What free surroundings take from the stiffness that the nodes have with all others held: the subtrahend
  // of the Schur complement, K_po K_oo^-1 K_op with o the others. Symmetric, not negative.
  [[nodiscard]] Eigen::MatrixXd softening_N_m(const std::vector<int>& nodes) const;

  // Factor on the springs from the nodes to free nodes outside, in [0, 1], with which the nodes at their
  // ends, all outside held, yield on average (trace of the compliance) as in the whole body. 1 where there
  // are no such springs. It exists: held surroundings are stiffer than the body's, none are softer; and is
  // unique, for a stiffer spring makes no node softer.
  [[nodiscard]] double spring_factor(const std::vector<int>& nodes) const;

 private:
  struct Factor;
  const Body& body_;
  std::unique_ptr<Factor> factor_;
};

}  // namespace palpate::host
