// Prints as JSON how much the force jumps at the edges of triangles, flat against smooth, where a tip is
// dragged 5 mm deep over 20 cells of a 24x12x12 body (docs/decisions/smooth_normals.md).
#include <cstdio>

#include "host/bench/edge_drag.hpp"

namespace {

using namespace palpate;
using namespace palpate::host;

void print(const char* surface, const EdgeJumps& jumps) {
  std::printf(
      "\"%s\": {\"ticks\": %u, \"crossings\": %u, \"free_ticks\": %u, \"largest_force_N\": %.5g, "
      "\"jump_N\": %.5g, \"median_jump_N\": %.5g, \"largest_change_N\": %.5g, \"largest_jump_any_N\": %.5g}",
      surface, jumps.ticks, jumps.crossings, jumps.free_ticks, jumps.largest_force_N, jumps.jump_N,
      jumps.median_jump_N, jumps.largest_change_N, jumps.largest_jump_any_N);
}

}  // namespace

int main() {
  std::fputs("[", stdout);
  const char* separator = "";
  for (const double speed_m_s : {0.05, 0.1}) {
    for (const double friction : {0.0, 0.3, 1.0}) {
      EdgeDrag drag;
      drag.speed_m_s = speed_m_s;
      drag.friction = friction;
      drag.surface = SurfaceKind::flat;
      const EdgeJumps flat = measure_edge_jumps(drag);
      drag.surface = SurfaceKind::smooth;
      const EdgeJumps smooth = measure_edge_jumps(drag);
      std::printf("%s{\"speed_m_s\": %g, \"friction\": %g, ", separator, speed_m_s, friction);
      print("flat", flat);
      std::fputs(", ", stdout);
      print("smooth", smooth);
      std::printf(", \"ratio\": %.4g}", flat.jump_N / smooth.jump_N);
      separator = ",\n ";
    }
  }
  std::puts("]");
  return 0;
}
