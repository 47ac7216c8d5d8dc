// In which direction a sphere touches: over a sharp edge or corner that of its own centre, so that it rolls
// around it at its radius; elsewhere that of the smooth surface.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/contact/surface_point.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// Sine of the angle between a node's normal and a triangle's: up to the first the node is smooth there, from
// the second on sharp: edges that bend by 53 and by 81 degrees. A lattice's edges and corners have 0.71 and
// 0.82.
inline constexpr double kSmoothNode = 0.45;
inline constexpr double kSharpNode = 0.65;
// Only where it leans outward, away from the triangle: in a dimple the sphere touches on both sides of an
// edge. Cosine of the angle to the straight way out, from which it counts in full; the edges of a lattice
// have 0.45 to 0.95.
inline constexpr double kConvex = 0.4;

namespace contact_detail {

// How far a value has come from `low` to `high`: 0 to 1.
template <class Real>
Real share_of(Real value, Real low, Real high) {
  return !(value > low) ? Real(0) : value < high ? (value - low) / (high - low) : Real(1);
}

template <class Real>
struct BallNormal {
  Vec3<Real> normal{};  // unit, outward
  Real smooth = 0;      // 1: of a smooth place, 0: of a sharp one
};

// At the contact point, at the start of the newest step. `offset_m`: from there to the centre; zero where
// that is not known: then the triangle's normal stands for it. On triangles' edges and nodes only: within a
// triangle the centre is over it.
template <class Surface, class Real>
BallNormal<Real> ball_normal(Surface& surface, const ContactState<Real>& state, const Vec3<Real>& offset_m,
                             Real radius_m) {
  const auto x = corners_at(surface, state.triangle, Real(0));
  const Vec3<Real> face = normalized(cross(x[1] - x[0], x[2] - x[0]));
  BallNormal<Real> result{};
  const Vec3<Real> middle = (x[0] + x[1] + x[2]) * (Real(1) / Real(3));
  Vec3<Real> sum{};
  for (std::size_t c = 0; c < 3 && surface.kind() == SurfaceKind::smooth; ++c) {
    Vec3<Real> corner{};
    corner[c] = 1;
    const Vec3<Real> node = surface.normal_before(state.triangle, corner);
    const Vec3<Real> bend = node - face * dot(node, face);
    const Real bends = norm(bend), outward = -dot(bend, normalized(middle - x[c]));
    const Real sharp = share_of(bends, static_cast<Real>(kSmoothNode), static_cast<Real>(kSharpNode)) *
                       share_of(outward, Real(0), static_cast<Real>(kConvex) * bends);
    const Real smooth = 1 - sharp;
    result.smooth += state.barycentric[c] * smooth;
    sum += node * (state.barycentric[c] * smooth);
  }
  const bool within = state.barycentric.x > 0 && state.barycentric.y > 0 && state.barycentric.z > 0;
  // Pressed in far, as at a fixed node, the centre is no guide any more.
  const Real out_m = norm(offset_m);
  const bool known = !within && out_m > radius_m * Real(0.5) && dot(offset_m, face) > -radius_m * Real(0.25);
  const Vec3<Real> own = known ? offset_m * (1 / out_m) : face;
  result.normal = normalized(own * (1 - result.smooth) + sum);
  return result;
}

}  // namespace contact_detail
}  // namespace palpate
