// Points on a body's surface.
#pragma once

#include <Eigen/Core>

#include "host/msd/body.hpp"

namespace palpate::host {

// A point that moves with the surface.
struct SurfacePoint {
  int triangle = 0;                                       // index in Body::triangles()
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();  // weights of its corners; not negative, sum 1
};

// Where the point is; the frame of position_m (3 x nodes).
Eigen::Vector3d surface_position_m(const Body& body, const Eigen::Matrix3Xd& position_m,
                                   const SurfacePoint& point);

// The surface point closest to `target_m`; of several equally close ones that on the lowest-numbered
// triangle. Looks at every triangle. Throws std::invalid_argument for a body without a surface.
SurfacePoint nearest_surface_point(const Body& body, const Eigen::Matrix3Xd& position_m,
                                   const Eigen::Vector3d& target_m);

}  // namespace palpate::host
