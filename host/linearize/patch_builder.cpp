#include "host/linearize/patch_builder.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "host/linearize/modal_reduction.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {

LocalModel build_subset_model(const Body& body, const BodyState& state, const std::vector<int>& nodes,
                              const SurfacePoint& contact, double step_s, const LocalModelCapacity& capacity,
                              const std::vector<int>& held, const Surroundings& around) {
  std::vector<int> moving = nodes;
  std::erase_if(moving, [&](int node) { return std::binary_search(held.begin(), held.end(), node); });
  const SubsetTangent tangent = subset_tangent(body, state, moving, around.outside);
  const Eigen::Index dofs = tangent.mass_kg.size();
  if (dofs > capacity.modes)
    throw std::invalid_argument("the local model has " + std::to_string(dofs) + " modes, allowed: at most " +
                                std::to_string(capacity.modes));
  Eigen::MatrixXd stiffness_N_m = -tangent.df_dx_N_m;
  if (around.softening_N_m.size() > 0) stiffness_N_m -= around.softening_N_m;
  const ModalBasis modes = reduce_to_modes(stiffness_N_m, -tangent.df_dv_N_s_m, tangent.mass_kg);

  LocalModel model;
  model.lambda_rad2_s2 = modes.lambda_rad2_s2;
  model.damping_rad_s = modes.damping_rad_s;
  model.damping_1_s = modes.damping_1_s;
  model.damping_coupling = modes.damping_coupling;
  model.stiffness_asymmetry = modes.stiffness_asymmetry;
  set_step(model, step_s);

  Eigen::VectorXd force_N(dofs);
  Eigen::VectorXd momentum_kg_m_s(dofs);
  for (Eigen::Index d = 0; d < dofs; ++d) {
    const int node = tangent.node[static_cast<std::size_t>(d)];
    const int axis = tangent.axis[static_cast<std::size_t>(d)];
    // A node's degrees of freedom follow each other: evaluate its force once, at the first.
    if (axis == body.axes().front()) {
      const Eigen::Vector3d on_node_N = nodal_force_N(body, state, node);
      for (std::size_t a = 0; a < body.axes().size(); ++a)
        force_N[d + static_cast<Eigen::Index>(a)] = on_node_N[body.axes()[a]];
    }
    momentum_kg_m_s[d] = tangent.mass_kg[d] * state.velocity_m_s(axis, node);
  }
  model.q = Eigen::VectorXd::Zero(dofs);
  model.p = modes.basis_1_sqrt_kg.transpose() * momentum_kg_m_s;
  model.load = modes.basis_1_sqrt_kg.transpose() * force_N + model.damping_rad_s.cwiseProduct(model.p);

  set_surface(model, state, subset_surface(body, nodes, contact, surface_limit(capacity, dofs)), tangent.node,
              tangent.axis, modes.basis_1_sqrt_kg);
  return model;
}

LocalModel build_patch(const Body& body, const BodyState& state, const SurfacePoint& contact,
                       const PatchSize& size, double step_s, const LocalModelCapacity& capacity,
                       const std::vector<int>& held) {
  return build_subset_model(body, state, select_patch(body, contact, size), contact, step_s, capacity, held);
}

}  // namespace palpate::host
