#include "host/python/bindings/arrays.hpp"

#include <limits>

namespace palpate::python {
namespace {

void append(std::vector<double>& values, const Eigen::Matrix3Xd& columns) {
  values.insert(values.end(), columns.data(), columns.data() + columns.size());
}

}  // namespace

nb::object nodes_by_3(const Eigen::Matrix3Xd& columns) {
  std::vector<double> values;
  append(values, columns);  // column-major 3 x n is row-major n x 3
  return array(std::move(values), 3);
}

nb::object stacked(const std::vector<host::BodyState>& states, bool velocities, std::size_t nodes) {
  auto owned = std::make_unique<std::vector<double>>();
  owned->reserve(states.size() * nodes * 3);
  for (const host::BodyState& state : states)
    append(*owned, velocities ? state.velocity_m_s : state.position_m);
  double* data = owned->data();
  nb::capsule owner(owned.release(), [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, double>(data, {states.size(), nodes, 3}, owner));
}

nb::object vector3(const Vec3d& v) {
  return array(std::vector<double>{v.x, v.y, v.z});
}

nb::object triangle_friction(const host::Body& body, const host::FrictionSpec& friction) {
  const host::SurfaceFriction surface(body, friction);
  std::vector<double> coefficient;
  for (std::size_t t = 0; t < body.triangles().size(); ++t) {
    const Friction<double>& here = surface.of(static_cast<std::uint32_t>(t));
    coefficient.insert(coefficient.end(), {here.static_coefficient, here.kinetic_coefficient});
  }
  return array(std::move(coefficient), 2);
}

void add_body(nb::dict& result, const host::Body& body, const host::FrictionSpec& friction,
              const Eigen::Matrix3Xd& position_m, double time_s, const Vec3d* tip_m,
              const std::vector<int>& patch_nodes) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  result["body/time_s"] = time_s;
  result["body/rest_m"] = nodes_by_3(body.rest_position_m());
  result["body/position_m"] = nodes_by_3(position_m);
  result["body/tip_m"] = vector3(tip_m != nullptr ? *tip_m : Vec3d{kNone, kNone, kNone});
  result["body/triangles"] =
      columns3<std::uint32_t>(body.triangles(), [](const host::Triangle& t) { return t; });
  result["body/triangle_friction"] = triangle_friction(body, friction);
  result["body/patch_nodes"] = column<std::uint32_t>(patch_nodes, [](int node) { return node; });
}

}  // namespace palpate::python
