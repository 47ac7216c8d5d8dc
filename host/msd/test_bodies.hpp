// Bodies and states that the tests of host/msd and host/linearize share.
#pragma once

#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "host/msd/body.hpp"
#include "host/msd/lattice.hpp"

namespace palpate::host::test {

// The paper's material (m = 1 g, k = 100 N/m, cells of 1 cm) with a given damping ratio, bottom fixed.
inline LatticeSpec reference_spec(int nodes_per_side, double damping_ratio = 1.0) {
  LatticeSpec spec;
  spec.nodes = {nodes_per_side, nodes_per_side, nodes_per_side};
  spec.damping_N_s_m = damping_from_ratio(damping_ratio, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  return spec;
}

inline LatticeSpec planar_spec(int nodes_per_side, double damping_ratio = 1.0) {
  LatticeSpec spec = reference_spec(nodes_per_side, damping_ratio);
  spec.dimension = 2;
  spec.nodes[1] = 1;
  return spec;
}

// A body of three materials: a skin on top, a core that overlaps it and a single heavy node in the core.
// Bottom fixed; no y index beyond 0 in 2D.
inline LatticeSpec layered_spec(LatticeSpec spec) {
  const auto [nx, ny, nz] = spec.nodes;
  spec.regions = {{{0, 0, nz - 1}, {nx - 1, ny - 1, nz - 1}, 0.002, 300.0, 1.5},
                  {{1, ny / 3, 1}, {nx - 2, ny - 1, nz - 1}, 0.0005, 7.0, 0.0},
                  {{nx / 2, ny / 2, 2}, {nx / 2, ny / 2, 2}, 0.01, 1.0, 1.0}};
  return spec;
}

inline LatticeSpec free_spec(int nodes_per_side, double damping_ratio) {
  LatticeSpec spec = reference_spec(nodes_per_side, damping_ratio);
  spec.fixed_faces.clear();
  spec.allow_unsupported = true;
  return spec;
}

// Five nodes: a tetrahedron on a fixed base with a hanging node, springs of different constants in no order.
inline Body irregular_body() {
  BodyDescription body;
  body.mass_kg = {0.001, 0.002, 0.0015, 0.003, 0.001};
  body.rest_position_m.resize(3, 5);
  body.rest_position_m.col(0) << 0.0, 0.0, 0.0;
  body.rest_position_m.col(1) << 0.011, 0.001, 0.0;
  body.rest_position_m.col(2) << 0.002, 0.012, 0.001;
  body.rest_position_m.col(3) << 0.004, 0.003, 0.013;
  body.rest_position_m.col(4) << 0.005, 0.004, 0.025;
  body.fixed = {true, false, false, false, false};
  body.springs = {{0, 1, 120.0, 0.3, 0.010}, {2, 0, 80.0, 0.1, 0.012},  {3, 1, 100.0, 0.2, 0.014},
                  {2, 3, 90.0, 0.0, 0.015},  {1, 2, 70.0, 0.4, 0.0142}, {4, 3, 50.0, 0.05, 0.011},
                  {0, 3, 110.0, 0.2, 0.013}};
  body.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  body.gravity_m_s2 = {0.0, 0.0, -9.81};
  return Body(std::move(body));
}

// The same body as one that nobody knows to be a lattice.
inline Body without_lattice(const Body& body) {
  BodyDescription plain;
  plain.planar = body.planar();
  for (int node = 0; node < body.node_count(); ++node) {
    plain.mass_kg.push_back(body.mass_kg(node));
    plain.fixed.push_back(body.fixed(node));
  }
  plain.rest_position_m = body.rest_position_m();
  plain.springs = body.springs();
  plain.triangles = body.triangles();
  plain.gravity_m_s2 = body.gravity_m_s2();
  return Body(std::move(plain));
}

// Displaces and moves every free node at random along its movable axes, uniformly within the given
// amplitudes.
inline BodyState random_state(const Body& body, unsigned seed, double displacement_m, double speed_m_s) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  BodyState state = body.rest_state();
  for (int node = 0; node < body.node_count(); ++node) {
    if (body.fixed(node)) continue;
    for (const int axis : body.axes()) {
      state.position_m(axis, node) += displacement_m * uniform(random);
      state.velocity_m_s(axis, node) = speed_m_s * uniform(random);
    }
  }
  return state;
}

// The message of the exception that `action` throws; empty where it throws none of that kind.
template <class Exception, class Action>
std::string message_of(Action action) {
  try {
    action();
  } catch (const Exception& e) {
    return e.what();
  }
  return {};
}

}  // namespace palpate::host::test
