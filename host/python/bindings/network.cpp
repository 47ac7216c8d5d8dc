#include "host/python/bindings/network.hpp"

#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::python {
namespace {

template <class T, class... Shape>
using Array = nb::ndarray<const T, Shape..., nb::c_contig, nb::device::cpu>;
template <class T>
using Column = Array<T, nb::ndim<1>>;
template <class T, int columns>
using Rows = Array<T, nb::shape<-1, columns>>;

template <class Kind>
Kind field(const nb::dict& network, const char* name, std::size_t rows) {
  const auto values = nb::cast<Kind>(network[name]);
  if (values.shape(0) != rows)
    throw std::invalid_argument(std::string("network.") + name + ": has " + std::to_string(values.shape(0)) +
                                " rows: must have " + std::to_string(rows));
  return values;
}

}  // namespace

host::Body read_network(const nb::dict& network, const Vec3d& gravity_m_s2) {
  const auto rest_m = nb::cast<Rows<double, 3>>(network["rest_position_m"]);
  const std::size_t nodes = rest_m.shape(0);
  const auto mass_kg = field<Column<double>>(network, "mass_kg", nodes);
  const auto fixed = field<Column<bool>>(network, "fixed", nodes);
  const auto ends = nb::cast<Rows<std::int64_t, 2>>(network["springs"]);
  const std::size_t springs = ends.shape(0);
  const auto stiffness_N_m = field<Column<double>>(network, "stiffness_N_m", springs);
  const auto damping_N_s_m = field<Column<double>>(network, "damping_N_s_m", springs);
  const auto length_m = field<Column<double>>(network, "rest_length_m", springs);
  const auto triangles = nb::cast<Rows<std::int64_t, 3>>(network["triangles"]);

  host::BodyDescription body;
  body.mass_kg.assign(mass_kg.data(), mass_kg.data() + nodes);
  body.fixed.assign(fixed.data(), fixed.data() + nodes);
  body.rest_position_m =
      Eigen::Map<const Eigen::Matrix3Xd>(rest_m.data(), 3, static_cast<Eigen::Index>(nodes));
  for (std::size_t s = 0; s < springs; ++s)
    body.springs.push_back({static_cast<int>(ends.data()[2 * s]), static_cast<int>(ends.data()[2 * s + 1]),
                            stiffness_N_m.data()[s], damping_N_s_m.data()[s], length_m.data()[s]});
  for (std::size_t t = 0; t < triangles.shape(0); ++t) {
    const std::int64_t* corner = triangles.data() + 3 * t;
    body.triangles.push_back(
        {static_cast<int>(corner[0]), static_cast<int>(corner[1]), static_cast<int>(corner[2])});
  }
  body.gravity_m_s2 = gravity_m_s2;
  return host::Body(std::move(body));
}

}  // namespace palpate::python
