// How much the force jumps where a tip that is dragged over the full body passes from triangle to triangle.
// Numbers and definition: docs/decisions/smooth_normals.md.
#pragma once

#include <array>
#include <cstdint>

#include "shared/contact/surface_kind.hpp"

namespace palpate::host {

// Pressed straight in from `clear_m` above the top, then dragged over `cells` cells along x and 0.19 times as
// many along y, so that the path is parallel to no edge and runs through no node; at rest at both ends of the
// press and of the drag. The body is the paper's material (1 g, 100 N/m, cells of 1 cm, damping ratio 1) with
// its bottom fixed.
struct EdgeDrag {
  std::array<int, 3> nodes{24, 12, 12};
  int cells = 20;
  double depth_m = 0.005;
  double clear_m = 0.002;
  double speed_m_s = 0.1;  // mean, of the drag
  double friction = 0.0;
  double step_s = 1e-4;
  SurfaceKind surface = SurfaceKind::smooth;
};

// Forces are means over servo ticks; with d_k the force's change from tick k - 1 to tick k, the jump of tick
// k is |d_k - (d_(k-1) + d_(k+1)) / 2|: a step of the force counts in full, a force that changes evenly not
// at all.
struct EdgeJumps {
  std::uint32_t ticks = 0;       // of the drag
  std::uint32_t crossings = 0;   // ticks that end on another triangle than they began on
  std::uint32_t free_ticks = 0;  // that end without contact
  double largest_force_N = 0;    // in the drag
  double jump_N = 0;            // largest of the ticks in which the triangle changes and of those right after
  double median_jump_N = 0;     // of the same ticks
  double largest_change_N = 0;  // |d_k| of the same ticks
  double largest_jump_any_N = 0;  // of all ticks of the drag
};

// Throws as simulate() and make_lattice() do.
EdgeJumps measure_edge_jumps(const EdgeDrag& drag);

}  // namespace palpate::host
