// A patch of a body linearized about one state, before any reduction: what section 4 of the paper works on.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "host/linearize/patch_selection.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host::paper {

// M dv/dt = f(x, v) = rest_force + df_dx (x - X0) + df_dv (v - V0), with M diagonal. Vectors hold 3 entries a
// node (row = 3 node + axis, device frame); every node can move, the nodes around the patch are held.
struct LinearPatch {
  std::vector<int> node;                   // the body's number of each node
  std::vector<std::array<int, 3>> corner;  // of each triangle, counter-clockwise from outside; into `node`
  Eigen::VectorXd mass_kg;                 // 3 equal entries a node
  Eigen::VectorXd rest_position_m;         // X0
  Eigen::VectorXd rest_velocity_m_s;       // V0
  Eigen::VectorXd rest_force_N;            // f(X0, V0)
  Eigen::MatrixXd df_dx_N_m;
  Eigen::MatrixXd df_dv_N_s_m;

  [[nodiscard]] Eigen::Index nodes() const { return mass_kg.size() / 3; }
  [[nodiscard]] Eigen::VectorXd force_N(const Eigen::VectorXd& x_m, const Eigen::VectorXd& v_m_s) const;
};

// Linearizes the free nodes of the patch around a contact point about `state`. Triangles with a fixed corner
// are left out: the paper's operators move all three corners. Throws std::invalid_argument for a planar body,
// as select_patch does, and where no triangle remains.
LinearPatch linear_patch(const Body& body, const BodyState& state, const SurfacePoint& contact,
                         const PatchSize& size);

// The largest step with which both schemes of section 4.2 are stable for the patch moving freely: explicit
// Euler as in (13) and Euler with the new velocity as in (12), (21). Infinite for a patch at which nothing
// acts; 0 where a mode is undamped, which explicit Euler lets grow at any step. Exact, by eigenvalues, for
// the free patch; the constraints take degrees of freedom away.
double largest_stable_step_s(const LinearPatch& patch);

}  // namespace palpate::host::paper
