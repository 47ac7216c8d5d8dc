// What all builders of local models do alike: surface and coefficients of a model whose modes are known.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/linearize/local_model.hpp"
#include "host/linearize/patch_selection.hpp"
#include "host/msd/body.hpp"
#include "shared/model/local_model.hpp"

namespace palpate::host {

// What a local model may hold; by default what the board's runtime can (shared/model).
struct LocalModelCapacity {
  int modes = static_cast<int>(kMaxModes);
  int surface_nodes = static_cast<int>(kMaxSurfaceNodes);
  int basis = static_cast<int>(kMaxBasis);  // 3 x surface nodes x modes
};

// The surface nodes that a model of so many modes has room for.
int surface_limit(const LocalModelCapacity& capacity, Eigen::Index modes);

// Sets step and coefficients from the model's lambda and damping.
void set_step(LocalModel& model, double step_s);

// Sets the surface at the state, and the rows of the basis that belong to its nodes. dof_node, dof_axis: of
// each row of dof_basis (1 / sqrt(kg)); they are kept in the model.
void set_surface(LocalModel& model, const BodyState& state, SubsetSurface surface, std::vector<int> dof_node,
                 std::vector<int> dof_axis, Eigen::MatrixXd dof_basis);

// For a model whose basis and coefficients do not depend on the state: puts its origin where it is at rest,
// and sets rest_m.
void set_rest(LocalModel& model, const Body& body);

}  // namespace palpate::host
