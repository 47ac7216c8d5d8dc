// An unreduced linear mass-spring-damper patch in fixed storage: equation (3) of the paper, all nodes
// movable.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/math/linear.hpp"

namespace palpate {

// The constant part, owned by someone else. Vectors have 3 entries a node, matrices 3 nodes x 3 nodes, row by
// row.
template <class Real>
struct LinearPatchView {
  std::uint32_t nodes = 0;
  std::uint32_t triangles = 0;
  const Real* mass_kg = nullptr;            // one a node
  const Real* rest_position_m = nullptr;    // X0
  const Real* rest_velocity_m_s = nullptr;  // V0
  const Real* rest_force_N = nullptr;       // f(X0, V0)
  const Real* df_dx_N_m = nullptr;          // F = [df/dX df/dV]
  const Real* df_dv_N_s_m = nullptr;
  const std::uint32_t* corner = nullptr;  // 3 a triangle, counter-clockwise from outside
};

// State of a patch of at most kNodes nodes: displacements from X0, so that they keep their digits in single
// precision, and velocities. Starts at X0, V0. Models PaperPatch.
template <class RealType, std::size_t kNodes>
class LinearPatch {
 public:
  using Real = RealType;
  static constexpr std::size_t kCapacity = kNodes;

  // view.nodes must be at most kNodes.
  explicit LinearPatch(const LinearPatchView<Real>& view) : view_(view) {
    for (std::uint32_t n = 0; n < view.nodes; ++n) velocity_m_s_[n] = at(view.rest_velocity_m_s, n);
  }

  [[nodiscard]] std::uint32_t node_count() const { return view_.nodes; }
  [[nodiscard]] std::uint32_t triangle_count() const { return view_.triangles; }
  [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t t) const {
    return {view_.corner[3 * t], view_.corner[3 * t + 1], view_.corner[3 * t + 2]};
  }
  [[nodiscard]] Real mass_kg(std::uint32_t n) const { return view_.mass_kg[n]; }
  [[nodiscard]] Vec3<Real> position(std::uint32_t n) const {
    return at(view_.rest_position_m, n) + displacement_m_[n];
  }
  [[nodiscard]] Vec3<Real> displacement(std::uint32_t n) const { return displacement_m_[n]; }
  [[nodiscard]] Vec3<Real> velocity(std::uint32_t n) const { return velocity_m_s_[n]; }
  void displace(std::uint32_t n, const Vec3<Real>& d) { displacement_m_[n] += d; }
  void set_velocity(std::uint32_t n, const Vec3<Real>& v) { velocity_m_s_[n] = v; }

  // f = f(X0, V0) + df/dX (x - X0) + df/dV (v - V0).
  void evaluate_forces() {
    std::array<Vec3<Real>, kNodes> relative{};
    for (std::uint32_t n = 0; n < view_.nodes; ++n)
      relative[n] = velocity_m_s_[n] - at(view_.rest_velocity_m_s, n);
    const std::size_t columns = 3 * static_cast<std::size_t>(view_.nodes);
    for (std::uint32_t n = 0; n < view_.nodes; ++n) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Real* kx = view_.df_dx_N_m + (3 * n + axis) * columns;
        const Real* kv = view_.df_dv_N_s_m + (3 * n + axis) * columns;
        Real sum = 0;
        for (std::uint32_t c = 0; c < view_.nodes; ++c, kx += 3, kv += 3) {
          const Vec3<Real>&d = displacement_m_[c], &v = relative[c];
          sum += kx[0] * d.x + kx[1] * d.y + kx[2] * d.z + (kv[0] * v.x + kv[1] * v.y + kv[2] * v.z);
        }
        force_N_[n][axis] = view_.rest_force_N[3 * n + axis] + sum;
      }
    }
  }
  [[nodiscard]] Vec3<Real> force(std::uint32_t n) const { return force_N_[n]; }

 private:
  static Vec3<Real> at(const Real* values, std::uint32_t n) {
    return {values[3 * n], values[3 * n + 1], values[3 * n + 2]};
  }

  LinearPatchView<Real> view_;
  std::array<Vec3<Real>, kNodes> displacement_m_{}, velocity_m_s_{}, force_N_{};
};

}  // namespace palpate
