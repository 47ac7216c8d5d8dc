#include "host/msd/tangent.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>
#include <unordered_map>

namespace palpate::host {
namespace {

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

// Derivatives of the force on node i by the separation d = x_j - x_i and by the relative velocity u = v_j -
// v_i.
struct SpringTangent {
  Eigen::Matrix3d by_separation_N_m = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_velocity_N_s_m = Eigen::Matrix3d::Zero();
};

SpringTangent spring_tangent(const Spring& spring, const BodyState& state) {
  const SpringState now = evaluate(spring, state.position_m, state.velocity_m_s);
  if (now.direction.isZero(0.0)) return {};
  const Eigen::Vector3d& n = now.direction;
  const Eigen::Vector3d& u = now.relative_velocity_m_s;
  const Eigen::Matrix3d along = n * n.transpose();
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along;
  const double damping_per_length = spring.damping_N_s_m / now.length_m;
  const Eigen::Vector3d sideways = u - u.dot(n) * n;
  return {spring.stiffness_N_m * along + (now.tension_N / now.length_m) * across +
              damping_per_length * n * sideways.transpose(),
          spring.damping_N_s_m * along};
}

}  // namespace

Tangent tangent(const Body& body, const BodyState& state) {
  using Triplet = Eigen::Triplet<double>;
  std::vector<Triplet> by_x;
  std::vector<Triplet> by_v;
  by_x.reserve(36 * body.springs().size());
  by_v.reserve(36 * body.springs().size());
  for (const Spring& spring : body.springs()) {
    const SpringTangent block = spring_tangent(spring, state);
    for (const int row_node : {spring.i, spring.j}) {
      for (const int column_node : {spring.i, spring.j}) {
        const double sign = row_node == column_node ? -1.0 : 1.0;
        for (const int row_axis : body.axes()) {
          for (const int column_axis : body.axes()) {
            const int row = body.dof(row_node, row_axis);
            const int column = body.dof(column_node, column_axis);
            if (row < 0 || column < 0) continue;
            by_x.emplace_back(row, column, sign * block.by_separation_N_m(row_axis, column_axis));
            by_v.emplace_back(row, column, sign * block.by_velocity_N_s_m(row_axis, column_axis));
          }
        }
      }
    }
  }
  const int dofs = body.dof_count();
  Tangent result;
  result.df_dx_N_m.resize(dofs, dofs);
  result.df_dv_N_s_m.resize(dofs, dofs);
  result.df_dx_N_m.setFromTriplets(by_x.begin(), by_x.end());
  result.df_dv_N_s_m.setFromTriplets(by_v.begin(), by_v.end());
  return result;
}

SubsetTangent subset_tangent(const Body& body, const BodyState& state, const std::vector<int>& nodes,
                             double outside) {
  SubsetTangent result;
  std::unordered_map<int, int> first_dof;  // of each node in the subset; -1 for fixed ones
  for (const int node : nodes) {
    if (node < 0 || node >= body.node_count())
      throw std::invalid_argument("node " + std::to_string(node) +
                                  " of the subset does not exist, allowed: 0 to " +
                                  std::to_string(body.node_count() - 1));
    const int first = body.fixed(node) ? -1 : static_cast<int>(result.node.size());
    if (!first_dof.emplace(node, first).second)
      throw std::invalid_argument("node " + std::to_string(node) + " comes twice in the subset");
    if (first < 0) continue;
    for (const int axis : body.axes()) {
      result.node.push_back(node);
      result.axis.push_back(axis);
    }
  }
  const auto dofs = static_cast<Eigen::Index>(result.node.size());
  result.mass_kg.resize(dofs);
  for (Eigen::Index d = 0; d < dofs; ++d)
    result.mass_kg[d] = body.mass_kg(result.node[at(static_cast<int>(d))]);
  result.df_dx_N_m.setZero(dofs, dofs);
  result.df_dv_N_s_m.setZero(dofs, dofs);

  const auto axes = body.axes();
  const auto add = [&](int row, int column, double sign, const SpringTangent& block) {
    for (std::size_t r = 0; r < axes.size(); ++r) {
      for (std::size_t c = 0; c < axes.size(); ++c) {
        result.df_dx_N_m(row + static_cast<int>(r), column + static_cast<int>(c)) +=
            sign * block.by_separation_N_m(axes[r], axes[c]);
        result.df_dv_N_s_m(row + static_cast<int>(r), column + static_cast<int>(c)) +=
            sign * block.by_velocity_N_s_m(axes[r], axes[c]);
      }
    }
  };
  for (const int node : nodes) {
    const int row = first_dof.at(node);
    if (row < 0) continue;
    for (const int s : body.springs_of(node)) {
      const Spring& spring = body.springs()[at(s)];
      const SpringTangent block = spring_tangent(spring, state);
      const int other_node = spring.i == node ? spring.j : spring.i;
      const auto other = first_dof.find(other_node);
      const bool leads_out = other == first_dof.end() && !body.fixed(other_node);
      add(row, row, leads_out ? -outside : -1.0, block);
      if (other != first_dof.end() && other->second >= 0) add(row, other->second, 1.0, block);
    }
  }
  return result;
}

TangentChanges::TangentChanges(const Body& body) : body_(body) {
  const BodyState rest = body.rest_state();
  rest_.reserve(body.springs().size());
  for (const Spring& spring : body.springs()) {
    const SpringTangent at_rest = spring_tangent(spring, rest);
    rest_.push_back({spring.i, spring.j, at_rest.by_separation_N_m, at_rest.by_velocity_N_s_m});
  }
}

void TangentChanges::find(const BodyState& state, double tolerance,
                          std::vector<TangentChange>& changes) const {
  changes.clear();
  for (std::size_t s = 0; s < rest_.size(); ++s) {
    const Spring& spring = body_.springs()[s];
    const SpringTangent now = spring_tangent(spring, state);
    const TangentChange change{spring.i, spring.j, now.by_separation_N_m - rest_[s].stiffness_N_m,
                               now.by_velocity_N_s_m - rest_[s].damping_N_s_m};
    if (change.stiffness_N_m.norm() > tolerance * spring.stiffness_N_m ||
        change.damping_N_s_m.norm() > tolerance * spring.damping_N_s_m)
      changes.push_back(change);
  }
}

}  // namespace palpate::host
