#include "host/linearize/near_springs.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "host/linearize/patch_selection.hpp"

namespace palpate::host {
namespace {

// Ascending; those on the surface of a model and below it that move, and none twice.
std::vector<int> moving_nodes(const LocalModel& model) {
  std::vector<int> nodes = model.dof_node;
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

}  // namespace

void add_near_field(LocalModel& model, const Body& body, const BodyState& state,
                    const LocalModelCapacity& capacity) {
  std::vector<int> below = nodes_below(body, moving_nodes(model), model.node);
  const auto room = static_cast<std::size_t>(surface_limit(capacity, model.modes())) - model.node.size();
  if (below.size() > room) below.resize(room);
  std::sort(below.begin(), below.end());
  const auto surface = static_cast<Eigen::Index>(model.node.size());
  const Eigen::Index nodes = surface + std::ssize(below);
  model.position_m.conservativeResize(Eigen::NoChange, nodes);
  model.basis.conservativeResize(3 * nodes, Eigen::NoChange);
  model.basis.bottomRows(3 * std::ssize(below)).setZero();
  for (Eigen::Index n = surface; n < nodes; ++n) {
    const int node = below[static_cast<std::size_t>(n - surface)];
    model.node.push_back(node);
    model.position_m.col(n) = state.position_m.col(node) - model.origin_m;
    for (std::size_t d = 0; d < model.dof_node.size(); ++d)
      if (model.dof_node[d] == node)
        model.basis.row(3 * n + model.dof_axis[d]) = model.dof_basis.row(static_cast<Eigen::Index>(d));
  }
  model.rest_m.conservativeResize(Eigen::NoChange, nodes);
  std::vector<int> column(static_cast<std::size_t>(body.node_count()), -1);
  for (Eigen::Index n = 0; n < nodes; ++n) {
    const int node = model.node[static_cast<std::size_t>(n)];
    model.rest_m.col(n) = body.rest_position_m().col(node) - model.origin_m;
    column[static_cast<std::size_t>(node)] = static_cast<int>(n);
  }
  for (const Spring& spring : body.springs()) {
    const int i = column[static_cast<std::size_t>(spring.i)], j = column[static_cast<std::size_t>(spring.j)];
    // Only springs at a node of the surface can come near.
    if (i < 0 || j < 0 || (i >= surface && j >= surface)) continue;
    model.springs.push_back({i, j, spring.stiffness_N_m, spring.damping_N_s_m, spring.rest_length_m});
  }
}

}  // namespace palpate::host
