// The constant description of a mass-spring-damper body, and its changing state.
//
// Equation (1) of Jacobs, Fu and Cavusoglu (IJRR 29(14), 2010): dX/dt = V, dV/dt = M^-1 f(X, V), with point
// masses M and f the sum of springs with axial dampers (spring.hpp), weight and contact. Fixed nodes do not
// move. All vectors are in the device frame.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "host/msd/spring.hpp"
#include "host/msd/vectors.hpp"
#include "shared/math/linear.hpp"

namespace palpate::host {

// What changes: column n is node n.
struct BodyState {
  Eigen::Matrix3Xd position_m;    // X
  Eigen::Matrix3Xd velocity_m_s;  // V
};

// A force on one node, in the device frame.
struct NodalForce {
  int node = 0;
  Vec3d force_N{};
};

// A triangle of the outer surface: nodes counter-clockwise seen from outside.
using Triangle = std::array<int, 3>;

// The regular grid behind a lattice body. Node index = i + nodes[0] (j + nodes[1] k).
struct LatticeShape {
  std::array<int, 3> nodes{};  // along x, y, z
  double spacing_m = 0;

  [[nodiscard]] int node(int i, int j, int k) const { return i + nodes[0] * (j + nodes[1] * k); }
  [[nodiscard]] std::array<int, 3> coordinates(int node) const {
    return {node % nodes[0], (node / nodes[0]) % nodes[1], node / (nodes[0] * nodes[1])};
  }
};

// Everything a Body is made of; column n and entry n are node n.
struct BodyDescription {
  bool planar =
      false;  // all motion in a plane of constant y: two degrees of freedom per free node instead of three
  std::vector<double> mass_kg;
  Eigen::Matrix3Xd rest_position_m;
  std::vector<bool> fixed;
  std::vector<Spring> springs;
  std::vector<Triangle> triangles;  // a closed surface, or none
  Vec3d gravity_m_s2{};
  std::optional<LatticeShape> lattice;
};

// An immutable body. Safe to share between threads. Integrators refer to it and must not outlive it.
class Body {
 public:
  // Throws std::invalid_argument, naming the entry, for sizes that do not match, masses or stiffnesses that
  // are not positive and finite, negative damping or rest length, springs that refer to no node or twice to
  // one, and surfaces that are not closed with consistent orientation.
  explicit Body(BodyDescription description);

  [[nodiscard]] int node_count() const { return static_cast<int>(description_.mass_kg.size()); }
  [[nodiscard]] bool planar() const { return description_.planar; }
  [[nodiscard]] double mass_kg(int node) const {
    return description_.mass_kg[static_cast<std::size_t>(node)];
  }
  [[nodiscard]] bool fixed(int node) const { return description_.fixed[static_cast<std::size_t>(node)]; }
  [[nodiscard]] const Eigen::Matrix3Xd& rest_position_m() const { return description_.rest_position_m; }
  [[nodiscard]] const Vec3d& gravity_m_s2() const { return description_.gravity_m_s2; }
  [[nodiscard]] const std::optional<LatticeShape>& lattice() const { return description_.lattice; }

  [[nodiscard]] const std::vector<Spring>& springs() const { return description_.springs; }
  // Indices into springs() of the springs that end at a node.
  [[nodiscard]] std::span<const int> springs_of(int node) const;

  // Outer surface; a triangle's number is its index here and never changes. Empty for planar bodies.
  [[nodiscard]] const std::vector<Triangle>& triangles() const { return description_.triangles; }
  // Per triangle, the triangle across the edge from corner e to corner (e + 1) mod 3.
  [[nodiscard]] const std::vector<std::array<int, 3>>& triangle_neighbours() const { return neighbours_; }

  // Degrees of freedom: the movable axes of the free nodes, node by node, in the order of axes().
  [[nodiscard]] int dof_count() const { return dof_count_; }
  [[nodiscard]] std::span<const int> axes() const;  // 0 1 2, or 0 2 for a planar body
  // Index of a node's degree of freedom along an axis; -1 where it has none.
  [[nodiscard]] int dof(int node, int axis) const {
    return dof_[static_cast<std::size_t>(3 * node) + static_cast<std::size_t>(axis)];
  }

  // At rest: every node at its rest position, velocity zero.
  [[nodiscard]] BodyState rest_state() const;

 private:
  BodyDescription description_;
  std::vector<std::array<int, 3>> neighbours_;
  std::vector<int>
      spring_start_;  // springs of node n: spring_of_[spring_start_[n]] up to spring_start_[n + 1]
  std::vector<int> spring_of_;
  std::vector<int> dof_;  // 3 per node
  int dof_count_ = 0;
};

}  // namespace palpate::host
