#include "host/msd/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/msd/lattice_surface.hpp"

namespace palpate::host {
namespace {

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

template <class Value>
[[noreturn]] void refuse(const std::string& field, const Value& value, const std::string& allowed) {
  std::ostringstream message;
  message << field << " is " << value << ", allowed: " << allowed;
  throw std::invalid_argument(message.str());
}

void require_positive(const std::string& field, double value) {
  if (!(value > 0) || !std::isfinite(value)) refuse(field, value, "positive and finite");
}

// Of the lattice (prefix "") or of a region.
void validate_material(const std::string& prefix, double mass_kg, double stiffness_N_m,
                       double damping_N_s_m) {
  require_positive(prefix + "mass_kg", mass_kg);
  require_positive(prefix + "stiffness_N_m", stiffness_N_m);
  if (!(damping_N_s_m >= 0) || !std::isfinite(damping_N_s_m))
    refuse(prefix + "damping_N_s_m", damping_N_s_m, "zero or positive, finite");
}

void validate_index(const std::string& field, std::size_t axis, int index, int low, int high) {
  if (index < low || index > high)
    refuse(field + " " + "xyz"[axis] + " index", index, std::to_string(low) + " to " + std::to_string(high));
}

void validate(const LatticeSpec& spec) {
  if (spec.dimension != 2 && spec.dimension != 3) refuse("dimension", spec.dimension, "2 or 3");
  constexpr std::array<const char*, 3> kNames{"nodes x", "nodes y", "nodes z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (spec.dimension == 2 && axis == 1) {
      if (spec.nodes[axis] != 1)
        refuse(kNames[axis], spec.nodes[axis], "1 in a 2D lattice, which lies in the x-z plane");
      continue;
    }
    if (spec.nodes[axis] < kMinLatticeNodes || spec.nodes[axis] > kMaxLatticeNodes)
      refuse(kNames[axis], spec.nodes[axis],
             std::to_string(kMinLatticeNodes) + " to " + std::to_string(kMaxLatticeNodes));
  }
  require_positive("spacing_m", spec.spacing_m);
  validate_material("", spec.mass_kg, spec.stiffness_N_m, spec.damping_N_s_m);
  if (!is_finite(spec.origin_m)) throw std::invalid_argument("origin_m is not finite");
  if (!is_finite(spec.gravity_m_s2)) throw std::invalid_argument("gravity_m_s2 is not finite");
  if (spec.dimension == 2 && spec.gravity_m_s2.y != 0)
    refuse("gravity_m_s2.y", spec.gravity_m_s2.y, "0 in a 2D lattice, which lies in the x-z plane");
  for (const Face face : spec.fixed_faces)
    if (spec.dimension == 2 && (face == Face::y_minus || face == Face::y_plus))
      refuse("fixed_faces", face == Face::y_minus ? "y-" : "y+", "x-, x+, z-, z+ in a 2D lattice");
  for (const auto& node : spec.fixed_nodes)
    for (std::size_t axis = 0; axis < 3; ++axis)
      validate_index("fixed_nodes", axis, node[axis], 0, spec.nodes[axis] - 1);
  for (std::size_t r = 0; r < spec.regions.size(); ++r) {
    const MaterialRegion& region = spec.regions[r];
    const std::string name = "regions[" + std::to_string(r) + "].";
    for (std::size_t axis = 0; axis < 3; ++axis) {
      validate_index(name + "from_node", axis, region.from_node[axis], 0, spec.nodes[axis] - 1);
      validate_index(name + "to_node", axis, region.to_node[axis], region.from_node[axis],
                     spec.nodes[axis] - 1);
    }
    validate_material(name, region.mass_kg, region.stiffness_N_m, region.damping_N_s_m);
  }
}

// One offset of each pair of opposite ones: the one that leads to a higher node index.
std::vector<std::array<int, 3>> half_neighbourhood(const LatticeSpec& spec) {
  const int most_axes =
      spec.neighbours == Neighbours::axis ? 1 : (spec.neighbours == Neighbours::edge ? 2 : 3);
  const int y_reach = spec.dimension == 2 ? 0 : 1;
  std::vector<std::array<int, 3>> offsets;
  for (int dz = -1; dz <= 1; ++dz)
    for (int dy = -y_reach; dy <= y_reach; ++dy)
      for (int dx = -1; dx <= 1; ++dx) {
        const bool forward = dz > 0 || (dz == 0 && (dy > 0 || (dy == 0 && dx > 0)));
        if (forward && std::abs(dx) + std::abs(dy) + std::abs(dz) <= most_axes)
          offsets.push_back({dx, dy, dz});
      }
  return offsets;
}

std::vector<Spring> lattice_springs(const LatticeSpec& spec, const LatticeShape& shape) {
  std::vector<Spring> springs;
  for (const auto& [dx, dy, dz] : half_neighbourhood(spec)) {
    const double rest_length_m = spec.spacing_m * std::sqrt(static_cast<double>(dx * dx + dy * dy + dz * dz));
    for (int k = std::max(0, -dz); k < shape.nodes[2] - std::max(0, dz); ++k)
      for (int j = std::max(0, -dy); j < shape.nodes[1] - std::max(0, dy); ++j)
        for (int i = std::max(0, -dx); i < shape.nodes[0] - std::max(0, dx); ++i)
          springs.push_back({shape.node(i, j, k), shape.node(i + dx, j + dy, k + dz), spec.stiffness_N_m,
                             spec.damping_N_s_m, rest_length_m});
  }
  return springs;
}

bool holds(const MaterialRegion& region, const std::array<int, 3>& node) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (node[axis] < region.from_node[axis] || node[axis] > region.to_node[axis]) return false;
  return true;
}

// In the order of the regions, so that the last one stays.
void apply_regions(const std::vector<MaterialRegion>& regions, const LatticeShape& shape,
                   BodyDescription& body) {
  for (const MaterialRegion& region : regions) {
    for (std::size_t node = 0; node < body.mass_kg.size(); ++node)
      if (holds(region, shape.coordinates(static_cast<int>(node)))) body.mass_kg[node] = region.mass_kg;
    for (Spring& spring : body.springs) {
      if (!holds(region, shape.coordinates(spring.i)) || !holds(region, shape.coordinates(spring.j)))
        continue;
      spring.stiffness_N_m = region.stiffness_N_m;
      spring.damping_N_s_m = region.damping_N_s_m;
    }
  }
}

bool is_fixed(const LatticeSpec& spec, const std::array<int, 3>& node) {
  return std::any_of(spec.fixed_faces.begin(), spec.fixed_faces.end(),
                     [&](Face face) {
                       const std::size_t axis = at(static_cast<int>(face) / 2);
                       const bool plus = static_cast<int>(face) % 2 == 1;
                       return node[axis] == (plus ? spec.nodes[axis] - 1 : 0);
                     }) ||
         std::find(spec.fixed_nodes.begin(), spec.fixed_nodes.end(), node) != spec.fixed_nodes.end();
}

}  // namespace

double damping_from_ratio(double ratio, double mass_kg, double stiffness_N_m) {
  if (!(ratio >= 0) || !std::isfinite(ratio)) refuse("damping ratio", ratio, "zero or positive, finite");
  require_positive("mass_kg", mass_kg);
  require_positive("stiffness_N_m", stiffness_N_m);
  return ratio * std::sqrt(2.0 * mass_kg * stiffness_N_m);
}

Body make_lattice(const LatticeSpec& spec) {
  validate(spec);
  const LatticeShape shape{spec.nodes, spec.spacing_m};
  const int count = spec.nodes[0] * spec.nodes[1] * spec.nodes[2];

  BodyDescription body;
  body.planar = spec.dimension == 2;
  body.mass_kg.assign(at(count), spec.mass_kg);
  body.rest_position_m.resize(3, count);
  body.fixed.resize(at(count));
  for (int node = 0; node < count; ++node) {
    const auto ijk = shape.coordinates(node);
    body.rest_position_m.col(node) =
        to_eigen(spec.origin_m) + spec.spacing_m * Eigen::Vector3d(ijk[0], ijk[1], ijk[2]);
    body.fixed[at(node)] = is_fixed(spec, ijk);
  }
  const auto fixed = std::count(body.fixed.begin(), body.fixed.end(), true);
  if (fixed == 0 && !spec.allow_unsupported)
    throw std::invalid_argument(
        "fixed_faces and fixed_nodes fix 0 nodes: a body with no fixed node, allowed: at least 1");
  if (fixed == count)
    throw std::invalid_argument("fixed_faces and fixed_nodes fix all " + std::to_string(count) +
                                " nodes, allowed: at least one free node");
  body.springs = lattice_springs(spec, shape);
  apply_regions(spec.regions, shape, body);
  if (!body.planar) body.triangles = lattice_triangles(shape);
  body.gravity_m_s2 = spec.gravity_m_s2;
  body.lattice = shape;
  return Body(std::move(body));
}

}  // namespace palpate::host
