// What the triangles of a contact surface stand for.
#pragma once

#include <cstdint>

namespace palpate {

// Values travel over the link (BasisHeader::surface): never renumber them.
enum class SurfaceKind : std::uint8_t {
  smooth = 0,  // the normal is interpolated between nodes: continuous across edges
  flat = 1,    // the normal is that of the triangle (Jacobs, Fu, Cavusoglu 2010, section 4.1)
};

}  // namespace palpate
