// Bodies from arrays: palpate.mesh.network.Network.
#pragma once

#include <nanobind/nanobind.h>

#include "host/msd/body.hpp"
#include "shared/math/linear.hpp"

namespace palpate::python {

namespace nb = nanobind;

// network: the fields of a Network by name. Throws std::invalid_argument for arrays that do not fit each
// other, and as Body does.
host::Body read_network(const nb::dict& network, const Vec3d& gravity_m_s2);

}  // namespace palpate::python
