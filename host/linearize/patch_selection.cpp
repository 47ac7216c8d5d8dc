#include "host/linearize/patch_selection.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/linearize/node_ball.hpp"

namespace palpate::host {
namespace {

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

const Triangle& triangle_of(const Body& body, int triangle) {
  if (triangle < 0 || at(triangle) >= body.triangles().size())
    throw std::invalid_argument("triangle " + std::to_string(triangle) + " does not exist, the surface has " +
                                std::to_string(body.triangles().size()) + " (2D lattices have none)");
  return body.triangles()[at(triangle)];
}

const LatticeShape& lattice_of(const Body& body) {
  if (!body.lattice()) throw std::invalid_argument("faces are those of a lattice; this body is none");
  return *body.lattice();
}

// Of these triangles those that hang together with `first` over edges; ascending as they are.
std::vector<int> connected(const Body& body, const std::vector<int>& triangles, int first) {
  std::set<int> reached{first};
  std::vector<int> open{first};
  while (!open.empty()) {
    const int triangle = open.back();
    open.pop_back();
    for (const int next : body.triangle_neighbours()[at(triangle)])
      if (std::binary_search(triangles.begin(), triangles.end(), next) && reached.insert(next).second)
        open.push_back(next);
  }
  return {reached.begin(), reached.end()};
}

}  // namespace

Face face_of_triangle(const Body& body, int triangle) {
  const LatticeShape& lattice = lattice_of(body);
  const Triangle& corners = triangle_of(body, triangle);
  std::array<std::array<int, 3>, 3> ijk{};
  for (std::size_t c = 0; c < 3; ++c) ijk[c] = lattice.coordinates(corners[c]);
  // The corners of a cell face differ along two axes and agree along the third: the normal.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (ijk[0][axis] != ijk[1][axis] || ijk[0][axis] != ijk[2][axis]) continue;
    return static_cast<Face>(2 * static_cast<int>(axis) + (ijk[0][axis] == 0 ? 0 : 1));
  }
  throw std::invalid_argument("triangle " + std::to_string(triangle) + " lies on no face of the lattice");
}

std::vector<int> cell_face(const Body& body, int triangle) {
  (void)triangle_of(body, triangle);
  if (!body.lattice()) return triangle_with_neighbour(body, triangle);
  (void)face_of_triangle(body, triangle);
  const LatticeShape& lattice = lattice_of(body);
  std::array<int, 3> low = lattice.coordinates(triangle_of(body, triangle)[0]), high = low;
  for (const int node : triangle_of(body, triangle)) {
    const std::array<int, 3> ijk = lattice.coordinates(node);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], ijk[axis]);
      high[axis] = std::max(high[axis], ijk[axis]);
    }
  }
  std::vector<int> nodes;
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) nodes.push_back(lattice.node(i, j, k));
  return nodes;
}

std::vector<int> neighbour_cells(const Body& body, int triangle) {
  (void)triangle_of(body, triangle);
  if (!body.lattice()) return triangles_around(body, triangle);
  const std::vector<int> own = cell_face(body, triangle);
  std::set<std::vector<int>> seen{own};
  std::vector<int> neighbours;
  for (int t = 0; t < std::ssize(body.triangles()); ++t) {
    const Triangle& corners = body.triangles()[at(t)];
    const bool touches = std::any_of(corners.begin(), corners.end(), [&](int node) {
      return std::find(own.begin(), own.end(), node) != own.end();
    });
    if (touches && seen.insert(cell_face(body, t)).second) neighbours.push_back(t);
  }
  return neighbours;
}

std::vector<int> select_patch(const Body& body, const SurfacePoint& contact, const PatchSize& size) {
  const Triangle& corners = triangle_of(body, contact.triangle);
  if (!body.lattice()) return node_ball(body, contact, size.along_first * size.along_second * size.depth);
  const LatticeShape& lattice = *body.lattice();
  const Face face = face_of_triangle(body, contact.triangle);
  const std::size_t normal = at(static_cast<int>(face) / 2);
  const bool plus = static_cast<int>(face) % 2 == 1;

  std::array<int, 3> count{};
  count[normal] = size.depth;
  count[normal == 0 ? 1 : 0] = size.along_first;
  count[normal == 2 ? 1 : 2] = size.along_second;
  std::array<int, 3> first{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int least = axis == normal ? 1 : 2;
    if (count[axis] < least || count[axis] > lattice.nodes[axis])
      throw std::invalid_argument("the patch has " + std::to_string(count[axis]) + " nodes along " +
                                  "xyz"[axis] + ", allowed: " + std::to_string(least) + " to " +
                                  std::to_string(lattice.nodes[axis]) + " (the lattice's)");
    if (axis == normal) {
      first[axis] = plus ? lattice.nodes[axis] - count[axis] : 0;
      continue;
    }
    double contact_index = 0;  // lattice coordinate of the contact point
    for (std::size_t c = 0; c < 3; ++c)
      contact_index +=
          contact.barycentric[static_cast<Eigen::Index>(c)] * lattice.coordinates(corners[c])[axis];
    const int centred = static_cast<int>(std::lround(contact_index - 0.5 * (count[axis] - 1)));
    first[axis] = std::clamp(centred, 0, lattice.nodes[axis] - count[axis]);
  }

  std::vector<int> nodes;
  for (int k = first[2]; k < first[2] + count[2]; ++k)
    for (int j = first[1]; j < first[1] + count[1]; ++j)
      for (int i = first[0]; i < first[0] + count[0]; ++i) nodes.push_back(lattice.node(i, j, k));
  return nodes;
}

SubsetSurface subset_surface(const Body& body, const std::vector<int>& nodes, const SurfacePoint& contact,
                             int node_limit) {
  if (node_limit < 3)
    throw std::invalid_argument("the surface's node limit is " + std::to_string(node_limit) +
                                ", allowed: at least 3");
  const std::set<int> inside(nodes.begin(), nodes.end());
  const auto lies_inside = [&](const Triangle& triangle) {
    return std::all_of(triangle.begin(), triangle.end(), [&](int node) { return inside.contains(node); });
  };
  if (!lies_inside(triangle_of(body, contact.triangle)))
    throw std::invalid_argument("triangle " + std::to_string(contact.triangle) +
                                " of the contact lies outside the patch");

  const Eigen::Vector3d contact_m = surface_position_m(body, body.rest_position_m(), contact);
  std::vector<int> candidates;
  for (int t = 0; t < std::ssize(body.triangles()); ++t)
    if (lies_inside(body.triangles()[at(t)])) candidates.push_back(t);
  if (!body.lattice()) candidates = connected(body, candidates, contact.triangle);
  std::vector<std::pair<double, int>> by_distance;  // squared distance of the centroid, triangle
  for (const int t : candidates) {
    const SurfacePoint centroid{t, Eigen::Vector3d::Constant(1.0 / 3.0)};
    const bool own = t == contact.triangle;
    const double squared =
        (surface_position_m(body, body.rest_position_m(), centroid) - contact_m).squaredNorm();
    by_distance.emplace_back(own ? -1.0 : squared, t);
  }
  std::sort(by_distance.begin(), by_distance.end());

  std::set<int> kept_nodes;
  SubsetSurface surface;
  for (const auto& [squared, t] : by_distance) {
    std::set<int> with = kept_nodes;
    with.insert(body.triangles()[at(t)].begin(), body.triangles()[at(t)].end());
    if (with.size() > at(node_limit)) continue;
    kept_nodes = std::move(with);
    surface.triangle.push_back(t);
  }
  std::sort(surface.triangle.begin(), surface.triangle.end());
  surface.node.assign(kept_nodes.begin(), kept_nodes.end());
  for (const int t : surface.triangle) {
    std::array<int, 3> corner{};
    for (std::size_t c = 0; c < 3; ++c) {
      const auto found =
          std::lower_bound(surface.node.begin(), surface.node.end(), body.triangles()[at(t)][c]);
      corner[c] = static_cast<int>(found - surface.node.begin());
    }
    surface.corner.push_back(corner);
  }
  return surface;
}

std::vector<int> nodes_below(const Body& body, const std::vector<int>& patch,
                             const std::vector<int>& surface) {
  const Eigen::Matrix3Xd& rest_m = body.rest_position_m();
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const int node : surface) middle_m += rest_m.col(node) / static_cast<double>(surface.size());
  std::vector<int> below;
  double farthest_m2 = 0;
  for (const int node : patch) {
    if (std::binary_search(surface.begin(), surface.end(), node)) continue;
    below.push_back(node);
    farthest_m2 = std::max(farthest_m2, (rest_m.col(node) - middle_m).squaredNorm());
  }
  // In millionths of the largest, so that rounding does not decide between equal ones.
  const auto distance = [&](int node) {
    return std::llround(1e6 * (rest_m.col(node) - middle_m).squaredNorm() / farthest_m2);
  };
  std::stable_sort(below.begin(), below.end(), [&](int a, int b) { return distance(a) < distance(b); });
  return below;
}

}  // namespace palpate::host
