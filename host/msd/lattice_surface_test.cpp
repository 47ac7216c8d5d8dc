#include "host/msd/lattice_surface.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <set>

#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

// That the surface is closed and consistently oriented is checked by Body itself, which every lattice passes
// through.
TEST(LatticeSurface, CoversTheSixFacesFacingOutwards) {
  LatticeSpec spec = test::reference_spec(4);
  spec.nodes = {3, 4, 6};
  const Body body = make_lattice(spec);
  ASSERT_EQ(body.triangles().size(), 2U * 2U * (2U * 3U + 3U * 5U + 2U * 5U));

  const Eigen::Vector3d centre_m = body.rest_position_m().rowwise().mean();
  double volume_m3 = 0;
  std::set<int> nodes;
  for (const Triangle& triangle : body.triangles()) {
    const Eigen::Vector3d a = body.rest_position_m().col(triangle[0]);
    const Eigen::Vector3d b = body.rest_position_m().col(triangle[1]);
    const Eigen::Vector3d c = body.rest_position_m().col(triangle[2]);
    const Eigen::Vector3d twice_area = (b - a).cross(c - a);
    EXPECT_NEAR(twice_area.norm(), spec.spacing_m * spec.spacing_m, 1e-12);
    EXPECT_GT(twice_area.dot((a + b + c) / 3.0 - centre_m), 0.0);
    volume_m3 += a.dot(b.cross(c)) / 6.0;  // divergence theorem
    nodes.insert(triangle.begin(), triangle.end());
  }
  EXPECT_NEAR(volume_m3, 2 * 3 * 5 * std::pow(spec.spacing_m, 3), 1e-15);
  // Euler's formula for a sphere, with three half-edges a triangle: V - E + F = V - F / 2 = 2.
  EXPECT_EQ(nodes.size() - body.triangles().size() / 2, 2U);
  EXPECT_EQ(nodes.size(), 3U * 4U * 6U - 1U * 2U * 4U);
}

TEST(LatticeSurface, FacesComeInTheirOrder) {
  const LatticeShape shape{{3, 3, 3}, 0.01};
  const auto triangles = lattice_triangles(shape);
  ASSERT_EQ(triangles.size(), 48U);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::size_t face = t / 8;
    for (const int node : triangles[t])
      EXPECT_EQ(shape.coordinates(node)[face / 2], face % 2 == 1 ? 2 : 0) << t;
  }
}

}  // namespace
}  // namespace palpate::host
