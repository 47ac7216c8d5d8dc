// How the contact point follows the tip over a triangulated surface that moves.
#pragma once

#include <cmath>
#include <cstdint>

#include "shared/contact/closest_point.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/contact/surface_point.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

namespace contact_detail {

// Moves the contact point to the place nearest to `target`: downhill from triangle to triangle, over the edge
// or around the node where the nearest place of the triangle lies. Every move comes closer, so no triangle is
// entered twice, however many edges are crossed. Returns that place.
template <class Surface, class Real>
Vec3<Real> walk(Surface& surface, std::uint32_t& triangle, Vec3<Real>& barycentric,
                const Vec3<Real>& target) {
  TrianglePoint<Real> best{};
  Real best_squared = 0;
  const auto look_at = [&](std::uint32_t t, bool first) {
    const auto corner = surface.corners(t);
    const auto candidate = closest_point(target, surface.position(corner[0]), surface.position(corner[1]),
                                         surface.position(corner[2]));
    const Vec3<Real> offset = target - candidate.position;
    const Real squared = dot(offset, offset);
    if (!first && !(squared < best_squared)) return;
    best = candidate;
    best_squared = squared;
    triangle = t;
  };
  look_at(triangle, true);
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t moves = 0; moves < count; ++moves) {
    const std::uint32_t here = triangle;
    const Vec3<Real> weight = best.barycentric;
    const std::uint32_t node = corner_of(weight);
    if (node == 3) {  // over the edge, if it lies on one
      for (std::uint32_t c = 0; c < 3; ++c) {
        const std::int32_t across = weight[c] != 0 ? kNoTriangle : surface.neighbour(here, c);
        if (across != kNoTriangle) look_at(static_cast<std::uint32_t>(across), false);
      }
    } else {  // around the node; where the border cuts that short, the other way, too
      std::int32_t around = 0;
      for (const bool forward : {true, false}) {
        std::uint32_t corner = node;
        around = static_cast<std::int32_t>(here);
        for (int i = 0; i < kMaxTrianglesAround; ++i) {
          around = next_around(surface, static_cast<std::uint32_t>(around), corner, forward);
          if (around == kNoTriangle || around == static_cast<std::int32_t>(here)) break;
          look_at(static_cast<std::uint32_t>(around), false);
        }
        if (around != kNoTriangle) break;
      }
    }
    if (triangle == here) break;
  }
  barycentric = best.barycentric;
  return best.position;
}

// Slower tips lean the less: at rest, noise in the tip's place must not turn the force.
inline constexpr double kLeanFully_m_s = 0.002;

// A height above the triangles that is forgotten gives way to the tip, and takes up its work. One below them
// rises, and would lift the pressing tip with no hand's work. There the forgetting is the surface's slope:
// along the tip's motion it rises by height / width, and the normal leans back by as much, against the
// motion. Not where the border holds the contact point: nothing is forgotten there. Sets the share of the
// forgetting that it is, and returns the normal (docs/decisions/contact_energy.md).
template <class Surface, class Real>
Vec3<Real> lean(Surface& surface, ContactState<Real>& state, const Vec3<Real>& normal,
                const Vec3<Real>& motion) {
  state.lean = 0;
  if (!(state.height_m < 0) || state.at_border || !(state.overhang_m == Vec3<Real>{})) return normal;
  const Vec3<Real> along = motion - normal * dot(normal, motion);
  const Real way = norm(along);
  if (!(way > 0)) return normal;
  const auto x = corners_at(surface, state.triangle, Real(0));
  const Real width = std::sqrt(norm(cross(x[1] - x[0], x[2] - x[0])));
  const Real full = static_cast<Real>(kLeanFully_m_s) * static_cast<Real>(surface.step_s());
  state.lean = way < full ? way / full : Real(1);
  return normalized(normal + along * (state.lean * state.height_m / (width * way)));
}

// Moves the contact point over the surface to where the tip is now. Returns by how much it falls short: along
// the surface, that is not zero at the border only.
//
// A smooth surface has its own height over the triangles: whatever way the contact point goes, the surface
// there is at right angles to the normal, so the height changes by what the triangles rise in direction of
// the normal. Without it the tip would follow the triangles' kinks, and each edge would be an impact. The
// height is forgotten over the width of a triangle (the root of twice its area): it never exceeds that, and
// does not depend on how the tip came here; see lean() for the work of that. A tip that is still pushed out
// of the body follows the triangles: the height's change must not add to the force, which is bounded there.
// Measured in docs/decisions/smooth_normals.md.
template <class Surface, class Real>
Vec3<Real> slide(Surface& surface, ContactState<Real>& state, const Vec3<Real>& tip, Real smooth = 1) {
  Vec3<Real> end{};
  if (surface.kind() == SurfaceKind::flat || state.inset_m > 0) {
    end = walk(surface, state.triangle, state.barycentric, tip);
    state.height_m = 0;
  } else {
    const auto corner = surface.corners(state.triangle);
    const Vec3<Real> a = surface.position(corner[0]), b = surface.position(corner[1]),
                     c = surface.position(corner[2]);
    const Vec3<Real> start = a * state.barycentric.x + b * state.barycentric.y + c * state.barycentric.z;
    // Where the line through the tip along the normal meets the plane of the triangle; on another triangle
    // the same from there, which leaves the square of the sine between the normals of a small rest.
    const Vec3<Real> area = cross(b - a, c - a);
    const Real width_squared = norm(area), facing = dot(area, state.normal);
    end = facing * 2 > width_squared ? tip + state.normal * (dot(area, start - tip) / facing) : tip;
    if (smooth < 1) end = end * smooth + tip * (1 - smooth);
    const std::uint32_t left = state.triangle;
    end = walk(surface, state.triangle, state.barycentric, end);
    if (state.triangle != left)
      end = walk(surface, state.triangle, state.barycentric,
                 tip + state.normal * (dot(state.normal, end - tip) * smooth));
    const Vec3<Real> moved = end - start;
    const Real moved_squared = dot(moved, moved);
    state.height_m -= dot(state.normal, moved);
    const Real forgotten = std::sqrt(moved_squared / width_squared) * (1 - state.lean);
    state.height_m *= forgotten < 1 ? 1 - forgotten : Real(0);
  }
  state.at_border = on_border(surface, state.triangle, state.barycentric);
  return tip - end;
}

}  // namespace contact_detail

}  // namespace palpate
