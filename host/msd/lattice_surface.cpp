#include "host/msd/lattice_surface.hpp"

#include <array>
#include <cstddef>

namespace palpate::host {

std::vector<Triangle> lattice_triangles(const LatticeShape& shape) {
  std::vector<Triangle> triangles;
  for (std::size_t normal = 0; normal < 3; ++normal) {
    const std::size_t u_axis = (normal + 1) % 3;
    const std::size_t v_axis = (normal + 2) % 3;
    for (const bool plus : {false, true}) {
      const auto node = [&](int u, int v) {
        std::array<int, 3> ijk{};
        ijk[normal] = plus ? shape.nodes[normal] - 1 : 0;
        ijk[u_axis] = u;
        ijk[v_axis] = v;
        return shape.node(ijk[0], ijk[1], ijk[2]);
      };
      for (int v = 0; v + 1 < shape.nodes[v_axis]; ++v) {
        for (int u = 0; u + 1 < shape.nodes[u_axis]; ++u) {
          const int low = node(u, v);
          const int high = node(u + 1, v + 1);
          const int side_u = node(u + 1, v);
          const int side_v = node(u, v + 1);
          triangles.push_back(plus ? Triangle{low, side_u, high} : Triangle{low, high, side_u});
          triangles.push_back(plus ? Triangle{low, high, side_v} : Triangle{low, side_v, high});
        }
      }
    }
  }
  return triangles;
}

}  // namespace palpate::host
