#include "host/linearize/model_surface.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace palpate::host {

int surface_limit(const LocalModelCapacity& capacity, Eigen::Index modes) {
  if (modes == 0) return capacity.surface_nodes;
  return std::min(capacity.surface_nodes, capacity.basis / (3 * static_cast<int>(modes)));
}

void set_step(LocalModel& model, double step_s) {
  model.step_s = step_s;
  model.coefficient.clear();
  for (Eigen::Index m = 0; m < model.lambda_rad2_s2.size(); ++m)
    model.coefficient.push_back(modal_coefficients(model.lambda_rad2_s2[m], model.damping_rad_s[m], step_s));
}

void set_surface(LocalModel& model, const BodyState& state, SubsetSurface surface, std::vector<int> dof_node,
                 std::vector<int> dof_axis, Eigen::MatrixXd dof_basis) {
  const auto nodes = static_cast<Eigen::Index>(surface.node.size());
  model.position_m.resize(3, nodes);
  model.basis = Eigen::MatrixXd::Zero(3 * nodes, dof_basis.cols());
  for (Eigen::Index n = 0; n < nodes; ++n)
    model.position_m.col(n) = state.position_m.col(surface.node[static_cast<std::size_t>(n)]);
  for (std::size_t d = 0; d < dof_node.size(); ++d) {
    const auto found = std::lower_bound(surface.node.begin(), surface.node.end(), dof_node[d]);
    if (found == surface.node.end() || *found != dof_node[d]) continue;
    model.basis.row(3 * (found - surface.node.begin()) + dof_axis[d]) =
        dof_basis.row(static_cast<Eigen::Index>(d));
  }
  model.dof_node = std::move(dof_node);
  model.dof_axis = std::move(dof_axis);
  model.dof_basis = std::move(dof_basis);
  model.origin_m = model.position_m.rowwise().mean();
  model.position_m.colwise() -= model.origin_m;
  model.node = std::move(surface.node);
  model.surface_nodes = static_cast<int>(nodes);
  model.triangle = std::move(surface.triangle);
  model.corner = std::move(surface.corner);
}

void set_rest(LocalModel& model, const Body& body) {
  const Eigen::Matrix3Xd rest_m = body.rest_state().position_m(Eigen::all, model.node);
  const Eigen::Vector3d origin_m = rest_m.rowwise().mean();
  model.position_m.colwise() += model.origin_m - origin_m;
  model.rest_m = rest_m.colwise() - origin_m;
  model.origin_m = origin_m;
}

}  // namespace palpate::host
