// A local model as the host holds it, in double precision, before it is quantized for the board.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "host/linearize/modal_coefficients.hpp"
#include "host/msd/spring.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// The same content as basis and state on the wire (shared/wire/model_contents.hpp), made by a builder for one
// state of the body. With q and p the modal positions and velocities, f the contact forces on the surface
// nodes (3 per node), and basis Phi:
//   displacement of the surface nodes from position_m = Phi q
//   modal force u = load + Phi' f,  then one step of each mode (modal_coefficients.hpp)
struct LocalModel {
  double step_s = 0;
  // Surface.
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  // device frame
  Eigen::Matrix3Xd position_m;                         // 3 x nodes, minus origin_m, at q = 0
  std::vector<int> node;                               // the body's number of each: the surface's first
  int surface_nodes = 0;                               // of them; others are known to the near field only
  std::vector<int> triangle;                           // the body's number of each triangle
  std::vector<std::array<int, 3>> corner;              // of each triangle; columns of position_m
  // Where basis and coefficients are constants of body and patch: rest positions, 3 x nodes, minus origin_m,
  // both the same from state to state, and the point that the patch was chosen around. Otherwise empty.
  Eigen::Matrix3Xd rest_m;
  std::optional<SurfacePoint> chosen_around;
  // Modes.
  std::vector<ModalCoefficients> coefficient;
  Eigen::VectorXd lambda_rad2_s2;
  Eigen::VectorXd damping_rad_s;
  Eigen::VectorXd load;   // constant modal force, N / sqrt(kg)
  Eigen::MatrixXd basis;  // (3 nodes) x modes, 1 / sqrt(kg); row = 3 node + axis; zero for fixed nodes
  // All degrees of freedom, those below the surface too: displacement = dof_basis q, velocity = dof_basis p.
  std::vector<int> dof_node, dof_axis;  // the body's number of the node, and the axis, of each row
  Eigen::MatrixXd dof_basis;            // 1 / sqrt(kg)
  Eigen::MatrixXd damping_1_s;          // Phi' D Phi, of which the board has the diagonal (damping_error.hpp)
  // State.
  Eigen::VectorXd q;  // sqrt(kg) m
  Eigen::VectorXd p;  // sqrt(kg) m / s
  // Near field (shared/model/near_field.hpp); none without springs. i and j: columns of position_m.
  std::vector<Spring> springs;  // with rest_m
  // Error indicators (modal_reduction.hpp).
  double damping_coupling = 0;
  double stiffness_asymmetry = 0;
  int limited_modes = 0;  // that would grow faster than they may (growth_limit.hpp)

  [[nodiscard]] Eigen::Index modes() const { return q.size(); }
};

}  // namespace palpate::host
