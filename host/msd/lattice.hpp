// Regular lattices of point masses: the bodies of the paper (sections 2.2 and 5.1).
#pragma once

#include <array>
#include <vector>

#include "host/msd/body.hpp"
#include "shared/math/linear.hpp"

namespace palpate::host {

// Which neighbours of a node a spring leads to.
enum class Neighbours {
  axis,  // along the axes: 4 in 2D, 6 in 3D
  edge,  // and across face diagonals: 8 in 2D, 18 in 3D
  full,  // and across space diagonals: 8 in 2D, 26 in 3D
};

// Outer faces of a lattice, by axis and side.
enum class Face { x_minus = 0, x_plus, y_minus, y_plus, z_minus, z_plus };

// A box of nodes, both corners included, of another material. A spring takes the stiffness and damping of the
// last region that holds both its end nodes, and a node the mass of the last region that holds it; all others
// take the lattice's own.
struct MaterialRegion {
  std::array<int, 3> from_node{};  // (i, j, k); j = 0 in 2D
  std::array<int, 3> to_node{};    // no index less than that of from_node
  double mass_kg = 0;              // all three have to be set
  double stiffness_N_m = 0;
  double damping_N_s_m = 0;
};

inline constexpr int kMinLatticeNodes = 2;
inline constexpr int kMaxLatticeNodes = 200;

// A lattice with cubic cells along the axes of the device frame. A 2D lattice lies in a plane of constant y:
// nodes[1] is 1, springs exist along x and z only, and nothing pulls a node out of the plane.
struct LatticeSpec {
  int dimension = 3;                     // 2 or 3
  std::array<int, 3> nodes{12, 12, 12};  // along x, y, z; 2 to 200 on the axes in use
  double spacing_m = 0.01;               // between neighbours along an axis
  Vec3d origin_m{};                      // of node (0, 0, 0)
  double mass_kg = 0.001;                // of each node
  double stiffness_N_m = 100.0;          // of each spring
  double damping_N_s_m = 0.0;            // of each spring, along it; see damping_from_ratio
  Neighbours neighbours = Neighbours::full;
  std::vector<MaterialRegion> regions;          // the later one counts where they overlap
  std::vector<Face> fixed_faces;                // no y faces in 2D
  std::vector<std::array<int, 3>> fixed_nodes;  // (i, j, k)
  Vec3d gravity_m_s2{};                         // y must be 0 in 2D
  bool allow_unsupported =
      false;  // accept a body with no fixed node: it drifts (for experiments in free fall)
};

// b = ratio sqrt(2 m k): the paper's damping ratio b / sqrt(2 m k) (Table 2); 1 is its critically damped
// material.
double damping_from_ratio(double ratio, double mass_kg, double stiffness_N_m);

// Builds the body. Rest lengths are the distances in the undeformed lattice. The surface of a 3D lattice are
// its six faces in the order of Face, each cell face split in two triangles; 2D lattices have no surface.
// Throws std::invalid_argument, naming the field, its value and the allowed range; also for a body with no
// fixed node (unless allowed) or with no free one.
Body make_lattice(const LatticeSpec& spec);

}  // namespace palpate::host
