#include "host/linearize/patch_selection.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

struct Box {
  std::array<int, 3> first;
  std::array<int, 3> last;
};

Box box_of(const Body& body, const std::vector<int>& nodes) {
  Box box{{1000, 1000, 1000}, {-1, -1, -1}};
  for (const int node : nodes) {
    const auto ijk = body.lattice()->coordinates(node);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.first[axis] = std::min(box.first[axis], ijk[axis]);
      box.last[axis] = std::max(box.last[axis], ijk[axis]);
    }
  }
  return box;
}

SurfacePoint point_at(const Body& body, double x_m, double y_m, double z_m) {
  return nearest_surface_point(body, body.rest_position_m(), {x_m, y_m, z_m});
}

TEST(PatchSelection, IsCentredOnTheContact) {
  const Body body = make_lattice(test::reference_spec(12));
  const auto nodes = select_patch(body, point_at(body, 0.053, 0.068, 0.12), {4, 4, 2});
  EXPECT_EQ(nodes.size(), 32U);
  EXPECT_TRUE(std::is_sorted(nodes.begin(), nodes.end()));
  const Box box = box_of(body, nodes);
  EXPECT_EQ(box.first, (std::array<int, 3>{4, 5, 10}));  // 5.3 - 1.5 = 3.8, 6.8 - 1.5 = 5.3
  EXPECT_EQ(box.last, (std::array<int, 3>{7, 8, 11}));
}

TEST(PatchSelection, StaysInTheLatticeOnEveryFace) {
  LatticeSpec spec = test::reference_spec(4);
  spec.nodes = {6, 7, 8};
  const Body body = make_lattice(spec);
  const PatchSize size{3, 4, 2};
  for (int t = 0; t < static_cast<int>(body.triangles().size()); ++t) {
    const SurfacePoint contact{t, Eigen::Vector3d::Constant(1.0 / 3.0)};
    const auto face = static_cast<int>(face_of_triangle(body, t));
    const auto normal = static_cast<std::size_t>(face / 2);
    const auto nodes = select_patch(body, contact, size);
    const Box box = box_of(body, nodes);
    std::array<int, 3> extent{};
    extent[normal] = 2;
    extent[normal == 0 ? 1 : 0] = 3;
    extent[normal == 2 ? 1 : 2] = 4;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_GE(box.first[axis], 0);
      EXPECT_LT(box.last[axis], spec.nodes[axis]);
      EXPECT_EQ(box.last[axis] - box.first[axis] + 1, extent[axis]);
    }
    EXPECT_EQ(face % 2 == 1 ? box.last[normal] : box.first[normal],
              face % 2 == 1 ? spec.nodes[normal] - 1 : 0);
    for (const int corner : body.triangles()[static_cast<std::size_t>(t)])
      EXPECT_TRUE(std::binary_search(nodes.begin(), nodes.end(), corner));
  }
}

TEST(PatchSelection, RefusesPatchesThatDoNotFit) {
  const Body body = make_lattice(test::reference_spec(4));
  const SurfacePoint contact = point_at(body, 0.015, 0.015, 0.1);
  EXPECT_EQ(select_patch(body, contact, {4, 4, 4}).size(), 64U);
  const std::string message = test::message_of<std::invalid_argument>([&] {
    select_patch(body, contact, {4, 5, 2});
  });
  EXPECT_NE(message.find("5 nodes along y, allowed: 2 to 4"), std::string::npos) << message;
  EXPECT_THROW(select_patch(body, contact, {4, 4, 5}), std::invalid_argument);
  EXPECT_THROW(select_patch(body, contact, {4, 4, 0}), std::invalid_argument);
  EXPECT_THROW(select_patch(body, contact, {1, 4, 2}), std::invalid_argument);
  EXPECT_THROW(select_patch(body, {-1, contact.barycentric}, {4, 4, 2}), std::invalid_argument);
  EXPECT_THROW(select_patch(body, {10000, contact.barycentric}, {4, 4, 2}), std::invalid_argument);
  EXPECT_THROW(face_of_triangle(test::irregular_body(), 0), std::invalid_argument);
  EXPECT_THROW(select_patch(make_lattice(test::planar_spec(6)), contact, {4, 4, 2}), std::invalid_argument);
}

TEST(SubsetSurface, HoldsTheTrianglesWithinThePatch) {
  const Body body = make_lattice(test::reference_spec(12));
  const SurfacePoint contact = point_at(body, 0.055, 0.055, 0.12);
  const SubsetSurface surface = subset_surface(body, select_patch(body, contact, {4, 4, 2}), contact, 32);
  EXPECT_EQ(surface.node.size(), 16U);
  EXPECT_EQ(surface.triangle.size(), 18U);
  ASSERT_EQ(surface.corner.size(), 18U);
  for (std::size_t t = 0; t < surface.triangle.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(surface.node[static_cast<std::size_t>(surface.corner[t][c])],
                body.triangles()[static_cast<std::size_t>(surface.triangle[t])][c]);
    }
  }
}

TEST(SubsetSurface, WrapsAroundTheBodysCorner) {
  const Body body = make_lattice(test::reference_spec(12));
  const SurfacePoint contact = point_at(body, 0.11, 0.11, 0.11);
  const auto nodes = select_patch(body, contact, {4, 4, 2});
  const SubsetSurface surface = subset_surface(body, nodes, contact, 32);
  EXPECT_EQ(surface.node.size(), 16U + 7U);  // the top and the row below along two sides
  EXPECT_EQ(surface.triangle.size(), 18U + 2U * 6U);
}

TEST(SubsetSurface, KeepsTheNearestTrianglesWithinTheLimit) {
  const Body body = make_lattice(test::reference_spec(12));
  const SurfacePoint contact = point_at(body, 0.108, 0.105, 0.11);
  const auto nodes = select_patch(body, contact, {4, 4, 4});
  const SubsetSurface whole = subset_surface(body, nodes, contact, 64);
  EXPECT_EQ(whole.node.size(), 37U);
  for (const int limit : {3, 5, 16, 32}) {
    const SubsetSurface cut = subset_surface(body, nodes, contact, limit);
    EXPECT_LE(cut.node.size(), static_cast<std::size_t>(limit));
    EXPECT_TRUE(std::binary_search(cut.triangle.begin(), cut.triangle.end(), contact.triangle));
    const std::set<int> all(whole.triangle.begin(), whole.triangle.end());
    for (const int t : cut.triangle) EXPECT_TRUE(all.contains(t));
  }
  EXPECT_GT(subset_surface(body, nodes, contact, 16).triangle.size(), 14U);
  EXPECT_THROW(subset_surface(body, nodes, contact, 2), std::invalid_argument);
  EXPECT_THROW(subset_surface(body, nodes, point_at(body, 0, 0, 0.11), 32), std::invalid_argument);
}

TEST(PatchSelection, ACellFaceIsThatOfBothItsTriangles) {
  const Body body = make_lattice(test::reference_spec(5));
  std::map<std::vector<int>, int> faces;
  for (std::size_t t = 0; t < body.triangles().size(); ++t) {
    const std::vector<int> nodes = cell_face(body, static_cast<int>(t));
    ASSERT_EQ(nodes.size(), 4U);
    for (const int corner : body.triangles()[t])
      EXPECT_TRUE(std::binary_search(nodes.begin(), nodes.end(), corner));
    ++faces[nodes];
  }
  EXPECT_EQ(faces.size(), 6U * 16U);
  for (const auto& [nodes, triangles] : faces) EXPECT_EQ(triangles, 2);
}

TEST(PatchSelection, NeighbourCellsAreAllThatShareANode) {
  const Body body = make_lattice(test::reference_spec(5));
  for (std::size_t t = 0; t < body.triangles().size(); ++t) {
    const std::vector<int> own = cell_face(body, static_cast<int>(t));
    const std::vector<int> neighbours = neighbour_cells(body, static_cast<int>(t));
    std::set<std::vector<int>> found;
    for (const int neighbour : neighbours) found.insert(cell_face(body, neighbour));
    EXPECT_EQ(found.size(), neighbours.size());  // each once
    std::set<std::vector<int>> expected;
    for (std::size_t other = 0; other < body.triangles().size(); ++other) {
      const std::vector<int> nodes = cell_face(body, static_cast<int>(other));
      if (nodes != own &&
          std::find_first_of(nodes.begin(), nodes.end(), own.begin(), own.end()) != nodes.end())
        expected.insert(nodes);
    }
    EXPECT_EQ(found, expected);
    // Around a corner of the cube three cells meet in place of four.
    EXPECT_TRUE(found.size() == 8 || found.size() == 7) << found.size();
  }
}

}  // namespace
}  // namespace palpate::host
