// The outer surface of a 3D lattice.
#pragma once

#include <vector>

#include "host/msd/body.hpp"

namespace palpate::host {

// The six faces in the order x-, x+, y-, y+, z-, z+; in each face the cells with the lower tangential axis
// running fastest (axes in cyclic order, so that they and the outward or inward normal are right-handed); in
// each cell two triangles that share the diagonal from its lowest to its highest corner. Counter-clockwise
// seen from outside.
std::vector<Triangle> lattice_triangles(const LatticeShape& shape);

}  // namespace palpate::host
