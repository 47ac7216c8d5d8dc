#include "host/msd/surface_point.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace palpate::host {
namespace {

// Barycentric weights of the point of segment a-b closest to p, as (weight of a, weight of b).
std::array<double, 2> closest_on_segment(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                         const Eigen::Vector3d& p) {
  const Eigen::Vector3d along = b - a;
  const double squared = along.squaredNorm();
  const double t = squared > 0 ? std::clamp((p - a).dot(along) / squared, 0.0, 1.0) : 0.0;
  return {1.0 - t, t};
}

// Inside the triangle's prism the orthogonal projection; elsewhere the closest of the three edges.
Eigen::Vector3d closest_on_triangle(const std::array<Eigen::Vector3d, 3>& corner, const Eigen::Vector3d& p) {
  const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  const double area_squared = normal.squaredNorm();
  if (area_squared > 0) {
    Eigen::Vector3d weight;
    for (std::size_t c = 0; c < 3; ++c) {
      const Eigen::Vector3d& from = corner[(c + 1) % 3];
      weight[static_cast<Eigen::Index>(c)] =
          (corner[(c + 2) % 3] - from).cross(p - from).dot(normal) / area_squared;
    }
    if (weight.minCoeff() >= 0) return weight / weight.sum();
  }
  Eigen::Vector3d best = Eigen::Vector3d::UnitX();
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t e = 0; e < 3; ++e) {
    const std::size_t f = (e + 1) % 3;
    const auto [weight_e, weight_f] = closest_on_segment(corner[e], corner[f], p);
    const double squared = (weight_e * corner[e] + weight_f * corner[f] - p).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      best.setZero();
      best[static_cast<Eigen::Index>(e)] = weight_e;
      best[static_cast<Eigen::Index>(f)] = weight_f;
    }
  }
  return best;
}

}  // namespace

Eigen::Vector3d surface_position_m(const Body& body, const Eigen::Matrix3Xd& position_m,
                                   const SurfacePoint& point) {
  const Triangle& triangle = body.triangles().at(static_cast<std::size_t>(point.triangle));
  return point.barycentric[0] * position_m.col(triangle[0]) +
         point.barycentric[1] * position_m.col(triangle[1]) +
         point.barycentric[2] * position_m.col(triangle[2]);
}

SurfacePoint nearest_surface_point(const Body& body, const Eigen::Matrix3Xd& position_m,
                                   const Eigen::Vector3d& target_m) {
  if (body.triangles().empty())
    throw std::invalid_argument("the body has no surface triangles (2D lattices have none)");
  SurfacePoint best;
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < body.triangles().size(); ++t) {
    const Triangle& triangle = body.triangles()[t];
    const std::array<Eigen::Vector3d, 3> corner{position_m.col(triangle[0]), position_m.col(triangle[1]),
                                                position_m.col(triangle[2])};
    const Eigen::Vector3d weight = closest_on_triangle(corner, target_m);
    const double squared =
        (weight[0] * corner[0] + weight[1] * corner[1] + weight[2] * corner[2] - target_m).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      best = {static_cast<int>(t), weight};
    }
  }
  return best;
}

}  // namespace palpate::host
