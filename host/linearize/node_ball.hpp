// The part of a body without a lattice that a local model covers: the nodes that are nearest to the contact.
#pragma once

#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// The `count` nodes to which the way along springs at rest is shortest from the corner of the contact's
// triangle that is nearest to the contact, and the other two corners, if need be in place of the farthest; of
// equally far ones those with lower numbers; all that springs lead to where they are fewer. Ascending. Ways
// along springs do not jump a gap between parts of the body. A corner, not the contact point, is the centre,
// so that contacts around one node share a patch and the board a basis. Throws std::invalid_argument for a
// count below 3.
std::vector<int> node_ball(const Body& body, const SurfacePoint& contact, int count);

// The corners of a triangle and, of the corners across its edges, the one that is nearest to its middle at
// rest. Ascending.
std::vector<int> triangle_with_neighbour(const Body& body, int triangle);

// The triangles that share a node with this one, without it. Ascending.
std::vector<int> triangles_around(const Body& body, int triangle);

}  // namespace palpate::host
