// The matrix of an implicit step, applied spring by spring without being assembled.
#pragma once

#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/spring_kernels.hpp"
#include "host/msd/spring_layout.hpp"
#include "host/msd/vectors.hpp"

namespace palpate::host {

// A = M + g D + g^2 K about a state, with K = -df/dX and D = -df/dV (tangent.hpp) except that the part of the
// dampers that is not symmetric is left out; Newton's residual is exact, so this costs iterations and not
// accuracy. Products are zero on fixed nodes (and along y for planar bodies). Holds no reference to the body.
class ImplicitMatrix {
 public:
  explicit ImplicitMatrix(const Body& body);

  // Linearizes about a state for the stage step g. With only_stretched, the negative geometric stiffness of
  // compressed springs is left out, which makes A positive definite always.
  void linearize(const NodalArray& position_m, const NodalArray& velocity_m_s, double stage_step_s,
                 bool only_stretched);

  // Solves A x = b (nodes x 3) by conjugate gradients with a Jacobi preconditioner, from x = 0, until the
  // residual in the norm of the preconditioner has shrunk by `reduction`. b and x are zero on fixed nodes.
  // Returns false where A proved not to be positive definite or the iteration count ran out.
  [[nodiscard]] bool solve(const NodalArray& b, double reduction, NodalArray& x);

  // product = A operand, for operands that are zero on fixed nodes.
  void apply(const NodalArray& operand, NodalArray& product) const;

 private:
  struct LinearBand {
    LinearBandView view;
    std::vector<double> storage;  // direction x, y, z and transverse, one after the other
  };
  struct LinearSpring {
    int i = 0;
    int j = 0;
    Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
  };
  void add_diagonal();

  SpringLayout layout_;
  NodalArray mass_kg_;
  NodalArray movable_;  // 1 or 0
  std::vector<LinearBand> bands_;
  std::vector<LinearSpring> loose_;
  NodalArray inverse_diagonal_;
  // Conjugate gradients.
  NodalArray residual_;
  NodalArray preconditioned_;
  NodalArray direction_;
  NodalArray product_;
};

}  // namespace palpate::host
