#include "host/msd/surface_point.hpp"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kRounding_m = 1e-15;  // of positions of some centimetres

TEST(SurfacePoint, ClosestPointOfABoxIsTheClampedPoint) {
  const Body body = make_lattice(test::reference_spec(4));
  const double side_m = 0.03;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.03, 0.06);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector3d target_m(uniform(random), uniform(random), uniform(random));
    const Eigen::Vector3d clamped_m = target_m.cwiseMax(0.0).cwiseMin(side_m);
    if ((clamped_m - target_m).norm() == 0) continue;  // inside
    const SurfacePoint point = nearest_surface_point(body, body.rest_position_m(), target_m);
    EXPECT_LT((surface_position_m(body, body.rest_position_m(), point) - clamped_m).norm(), kRounding_m);
    EXPECT_NEAR(point.barycentric.sum(), 1.0, 1e-14);
    EXPECT_GE(point.barycentric.minCoeff(), 0.0);
  }
}

TEST(SurfacePoint, ClosestPointFromInsideIsOnTheNearestFace) {
  const Body body = make_lattice(test::reference_spec(4));
  const SurfacePoint point = nearest_surface_point(body, body.rest_position_m(), {0.012, 0.016, 0.026});
  EXPECT_LT(
      (surface_position_m(body, body.rest_position_m(), point) - Eigen::Vector3d(0.012, 0.016, 0.03)).norm(),
      kRounding_m);
}

TEST(SurfacePoint, DegenerateTrianglesAnswerWithAnEdge) {
  const Body body = make_lattice(test::reference_spec(2));
  const Eigen::Matrix3Xd collapsed = Eigen::Matrix3Xd::Zero(3, body.node_count());
  const SurfacePoint point = nearest_surface_point(body, collapsed, {0.0, 0.0, 1.0});
  EXPECT_NEAR(point.barycentric.sum(), 1.0, 1e-14);
}

TEST(SurfacePoint, PlanarBodiesHaveNoSurface) {
  const Body body = make_lattice(test::planar_spec(4));
  EXPECT_THROW(nearest_surface_point(body, body.rest_position_m(), Eigen::Vector3d::Zero()),
               std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
