#include "host/linearize/hybrid_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <set>

#include "host/msd/lattice.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {
namespace {

constexpr double kMiddle_rad_s = 2.0 * std::numbers::pi * 20.0;

Body lattice(int side) {
  LatticeSpec spec;
  spec.nodes = {side, side, side};
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  return make_lattice(spec);
}

SurfacePoint over(const Body& body, int i, int j) {
  const LatticeShape& shape = *body.lattice();
  const Eigen::Vector3d between = body.rest_position_m().col(shape.node(i, j, shape.nodes[2] - 1)) +
                                  Eigen::Vector3d(0.4, 0.3, 0.0) * shape.spacing_m;
  return nearest_surface_point(body, body.rest_position_m(), between);
}

TEST(HybridBuilder, HasThePatchsNodesAndAllSpringsAtItsSurface) {
  const Body body = lattice(8);
  HybridBuilder builder(body, {}, 12, {kMiddle_rad_s}, 1e-3);
  const LocalModel model = builder.build(body.rest_state(), over(body, 3, 3), {});
  EXPECT_EQ(model.modes(), 3 * (16 + 12) + 12);
  EXPECT_EQ(model.surface_nodes, 16);
  ASSERT_EQ(model.node.size(), 32u);
  EXPECT_EQ(std::set<int>(model.node.begin(), model.node.end()).size(), 32u);
  // Of 4 x 4 x 2 nodes with 26 neighbours each in the lattice 184; 42 of them lie below the surface.
  EXPECT_EQ(model.springs.size(), 142u);
  EXPECT_EQ(model.basis.rows(), 96);
  for (const Spring& spring : model.springs) {
    EXPECT_NE(spring.i, spring.j);
    EXPECT_NEAR((model.rest_m.col(spring.j) - model.rest_m.col(spring.i)).norm(), spring.rest_length_m,
                1e-12);
  }
  for (std::size_t t = 0; t < model.triangle.size(); ++t)
    for (const int corner : model.corner[t]) EXPECT_LT(corner, model.surface_nodes);
}

TEST(HybridBuilder, StaysWithinTheCapacityAtTheBodysEdgesAndForOtherPatches) {
  const Body body = lattice(8);
  for (const PatchSize& size : {PatchSize{4, 4, 2}, PatchSize{4, 4, 3}, PatchSize{4, 4, 4},
                                PatchSize{4, 3, 3}, PatchSize{3, 3, 4}, PatchSize{2, 2, 8}}) {
    HybridBuilder builder(body, size, 12, {kMiddle_rad_s}, 1e-3);
    for (const auto& [i, j] :
         {std::pair{3, 3}, std::pair{0, 3}, std::pair{0, 0}, std::pair{6, 6}, std::pair{3, 6}}) {
      const LocalModel model = builder.build(body.rest_state(), over(body, i, j), {});
      EXPECT_LE(model.modes(), static_cast<Eigen::Index>(kMaxNearModes));
      EXPECT_LE(model.node.size(), kMaxSurfaceNodes);
      EXPECT_LE(static_cast<std::size_t>(model.basis.size()), kMaxBasis);
      EXPECT_LE(model.springs.size(), kMaxSprings);
      if (size.depth == 2) {
        EXPECT_GE(model.springs.size(), 100u);
      }
    }
  }
}

// Static answers of ports are exact: under a constant force on a surface node, or on one below it, the modes
// come to where the body does.
TEST(HybridBuilder, AnswersConstantForcesOnItsPortsExactly) {
  const Body body = lattice(6);
  HybridBuilder builder(body, {}, 12, {kMiddle_rad_s}, 1e-3);
  const LocalModel model = builder.build(body.rest_state(), over(body, 2, 2), {});
  WholeBodyReduction exact(body, {0.0});
  const LatticeShape& shape = *body.lattice();
  for (const int node : {shape.node(2, 3, 5), shape.node(3, 2, 4)}) {
    const WholeBodyBasis reference = exact.reduce({node});
    const auto found = std::find(model.node.begin(), model.node.end(), node);
    ASSERT_NE(found, model.node.end());
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::RowVectorXd row = model.basis.row(3 * (found - model.node.begin()) + axis);
      const double compliance = (row.cwiseAbs2().transpose().cwiseQuotient(model.lambda_rad2_s2)).sum();
      const Eigen::RowVectorXd exact_row = reference.basis_1_sqrt_kg.row(body.dof(node, axis));
      const double expected =
          (exact_row.cwiseAbs2().transpose().cwiseQuotient(reference.lambda_rad2_s2)).sum();
      EXPECT_NEAR(compliance, expected, 1e-5 * expected);  // bases are kept in single precision
    }
  }
}

}  // namespace
}  // namespace palpate::host
