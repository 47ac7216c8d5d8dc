// Between the project's small vectors (shared/math/linear.hpp), in both precisions, and Eigen's.
#pragma once

#include <Eigen/Core>

#include "shared/math/linear.hpp"

namespace palpate::host {

// One row per node, one column per axis: the components of an axis lie together in memory, as the vector
// kernels want.
using NodalArray = Eigen::Matrix<double, Eigen::Dynamic, 3>;

inline Eigen::Vector3d to_eigen(const Vec3d& a) {
  return {a.x, a.y, a.z};
}
inline Vec3d from_eigen(const Eigen::Vector3d& a) {
  return {a.x(), a.y(), a.z()};
}
inline Vec3d widen(const Vec3f& a) {
  return {static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)};
}
inline Vec3f narrow(const Vec3d& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}

}  // namespace palpate::host
