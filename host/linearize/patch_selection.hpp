// Which part of a body a local model covers: of a lattice the paper's 4x4x2 neighbourhood of the contact
// (section 2.3, Figure 7b), of another body as many nodes around it (node_ball.hpp).
#pragma once

#include <array>
#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/lattice.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// Nodes of a patch: along the lower and the higher of the two tangential axes of its face, and into the body.
struct PatchSize {
  int along_first = 4;
  int along_second = 4;
  int depth = 2;
};

// The lattice face that a surface triangle belongs to. Throws std::invalid_argument for a body that is not a
// lattice or has no such triangle.
Face face_of_triangle(const Body& body, int triangle);

// The four nodes, ascending, of the face of the lattice's cell that a surface triangle is half of; without a
// lattice those of the triangle and one across an edge. Throws std::invalid_argument for no such triangle.
std::vector<int> cell_face(const Body& body, int triangle);

// A triangle of each other cell's face that shares a node with that of a surface triangle, ascending; without
// a lattice every triangle that shares a node with it. Throws as cell_face.
std::vector<int> neighbour_cells(const Body& body, int triangle);

// Nodes of the box of lattice nodes that is centred on the contact point (in the undeformed lattice), starts
// at the face the triangle belongs to, and is shifted as little as needed to lie within the lattice.
// Ascending. Fixed nodes belong to it. Without a lattice: as many nodes around the contact (node_ball).
// Throws std::invalid_argument for a patch that is larger than the lattice or has a size below 1, 2 along the
// surface.
std::vector<int> select_patch(const Body& body, const SurfacePoint& contact, const PatchSize& size);

// Triangles of the body's surface that lie in a set of nodes.
struct SubsetSurface {
  std::vector<int> node;                   // ascending
  std::vector<int> triangle;               // ascending
  std::vector<std::array<int, 3>> corner;  // of each triangle; indices into `node`
};

// Triangles with all corners in `nodes`; without a lattice those that hang together with the contact's over
// edges, so that the far side of a thin body is not among them. Where they have more than node_limit corners,
// those nearest to the contact point at rest are kept, the contact's own triangle always. Throws
// std::invalid_argument where the contact's triangle does not lie in the nodes, or for a limit below 3.
SubsetSurface subset_surface(const Body& body, const std::vector<int>& nodes, const SurfacePoint& contact,
                             int node_limit);

// The nodes of a patch that are not on its surface (ascending), those nearest to the middle of the surface at
// rest first, equal ones in the order of their numbers.
std::vector<int> nodes_below(const Body& body, const std::vector<int>& patch,
                             const std::vector<int>& surface);

}  // namespace palpate::host
