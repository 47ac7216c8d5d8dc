// Results of the core as NumPy arrays.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "host/msd/body.hpp"
#include "host/session/surface_friction.hpp"
#include "shared/math/linear.hpp"

namespace palpate::python {

namespace nb = nanobind;

// A C-contiguous array that owns its values; columns 0: one-dimensional.
template <class T>
nb::object array(std::vector<T> values, std::size_t columns = 0) {
  auto owned = std::make_unique<std::vector<T>>(std::move(values));
  T* data = owned->data();
  const std::size_t size = owned->size();
  nb::capsule owner(owned.release(), [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  if (columns == 0) return nb::cast(nb::ndarray<nb::numpy, T>(data, {size}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T>(data, {size / columns, columns}, owner));
}

// One number, or one vector, per element of `from`.
template <class T, class From, class Get>
nb::object column(const std::vector<From>& from, Get get) {
  std::vector<T> values;
  values.reserve(from.size());
  for (const From& element : from) values.push_back(static_cast<T>(get(element)));
  return array(std::move(values));
}
template <class T, class From, class Get>
nb::object columns3(const std::vector<From>& from, Get get) {
  std::vector<T> values;
  values.reserve(3 * from.size());
  for (const From& element : from) {
    const auto vector = get(element);
    for (std::size_t axis = 0; axis < 3; ++axis) values.push_back(static_cast<T>(vector[axis]));
  }
  return array(std::move(values), 3);
}

// (nodes, 3) from 3 x nodes.
nb::object nodes_by_3(const Eigen::Matrix3Xd& columns);
// (states, nodes, 3)
nb::object stacked(const std::vector<host::BodyState>& states, bool velocities, std::size_t nodes);
nb::object vector3(const Vec3d& v);
// (triangles, 2): static and kinetic coefficient.
nb::object triangle_friction(const host::Body& body, const host::FrictionSpec& friction);

// The datasets body/* that every experiment returns. `tip_m` nullptr: there is none.
void add_body(nb::dict& result, const host::Body& body, const host::FrictionSpec& friction,
              const Eigen::Matrix3Xd& position_m, double time_s, const Vec3d* tip_m,
              const std::vector<int>& patch_nodes);

}  // namespace palpate::python
