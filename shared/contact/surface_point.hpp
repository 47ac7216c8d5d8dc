// Points of a moving surface: the closest one to the tip, on which side the tip is, and the border.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "shared/contact/closest_point.hpp"
#include "shared/contact/contact_surface.hpp"
#include "shared/math/linear.hpp"

namespace palpate::contact_detail {

// Triangles around a node that are looked at; more than in any lattice.
inline constexpr int kMaxTrianglesAround = 16;

template <class Real>
struct SurfacePoint {
  bool found = false;  // a triangle was within reach
  bool at_border =
      false;  // the point is on the border of the surface: on which side the tip is, is not known
  std::uint32_t triangle = 0;
  Vec3<Real> barycentric{};
  Vec3<Real> position_m{};
  Real distance_m = 0;  // signed: positive outside
};

// The motion of the tip in a step.
template <class Real>
struct TipMotion {
  Vec3<Real> from_m{}, to_m{};
  Real radius_m = 0;
};

template <class Real>
Vec3<Real> lerp(const Vec3<Real>& a, const Vec3<Real>& b, Real s) {
  return a + (b - a) * s;
}

// Corners of a triangle at fraction s of the step (0: before, 1: after).
template <class Surface, class Real>
std::array<Vec3<Real>, 3> corners_at(Surface& surface, std::uint32_t triangle, Real s) {
  const auto corner = surface.corners(triangle);
  std::array<Vec3<Real>, 3> x{};
  for (std::size_t c = 0; c < 3; ++c)
    x[c] = s == 1   ? surface.position(corner[c])
           : s == 0 ? surface.position_before(corner[c])
                    : lerp(surface.position_before(corner[c]), surface.position(corner[c]), s);
  return x;
}

// The triangle that comes next around corner `c` of a triangle, and the number of that node there; forward:
// clockwise. kNoTriangle: the border comes next.
template <class Surface>
std::int32_t next_around(const Surface& surface, std::uint32_t triangle, std::uint32_t& c,
                         bool forward = true) {
  const std::uint32_t node = surface.corners(triangle)[c];
  const std::int32_t next = surface.neighbour(triangle, (c + (forward ? 1u : 2u)) % 3);
  if (next == kNoTriangle) return next;
  const auto corner = surface.corners(static_cast<std::uint32_t>(next));
  c = corner[0] == node ? 0u : corner[1] == node ? 1u : 2u;
  return next;
}

// The corner in which the point lies; 3: none.
template <class Real>
std::uint32_t corner_of(const Vec3<Real>& barycentric) {
  for (std::uint32_t c = 0; c < 3; ++c)
    if (barycentric[(c + 1) % 3] == 0 && barycentric[(c + 2) % 3] == 0) return c;
  return 3;
}

template <class Surface, class Real>
bool on_border(const Surface& surface, std::uint32_t triangle, const Vec3<Real>& barycentric) {
  for (std::uint32_t c = 0; c < 3; ++c)
    if (barycentric[c] == 0 && surface.neighbour(triangle, c) == kNoTriangle) return true;
  std::uint32_t c = corner_of(barycentric);
  if (c == 3) return false;
  auto around = static_cast<std::int32_t>(triangle);
  for (int i = 0; i < kMaxTrianglesAround; ++i) {
    around = next_around(surface, static_cast<std::uint32_t>(around), c);
    if (around == kNoTriangle) return true;
    if (around == static_cast<std::int32_t>(triangle)) return false;
  }
  return false;
}

// Is a point behind the surface whose closest point of it is (triangle, barycentric), `offset` away? On an
// edge or a node several triangles are equally close, and a single one may well be seen from the other side:
// the one that the offset stands on most squarely decides.
template <class Surface, class Real>
bool is_behind(Surface& surface, std::uint32_t triangle, const Vec3<Real>& barycentric,
               const Vec3<Real>& offset, Real s) {
  Real squarest = 0, side = 0;
  const auto look_at = [&](std::uint32_t t) {
    const auto x = corners_at(surface, t, s);
    const Real height = dot(offset, normalized(cross(x[1] - x[0], x[2] - x[0])));
    if (std::fabs(height) <= squarest) return;
    squarest = std::fabs(height);
    side = height;
  };
  look_at(triangle);
  std::uint32_t c = corner_of(barycentric);
  if (c < 3) {
    auto around = static_cast<std::int32_t>(triangle);
    for (int i = 0; i < kMaxTrianglesAround; ++i) {
      around = next_around(surface, static_cast<std::uint32_t>(around), c);
      if (around == kNoTriangle || around == static_cast<std::int32_t>(triangle)) break;
      look_at(static_cast<std::uint32_t>(around));
    }
  } else {
    for (c = 0; c < 3; ++c)
      if (barycentric[c] == 0 && surface.neighbour(triangle, c) != kNoTriangle)
        look_at(static_cast<std::uint32_t>(surface.neighbour(triangle, c)));
  }
  return side < 0;
}

enum class Search : std::uint8_t { within_reach, everywhere };

// Closest point of the surface to `point`, with nodes at fraction s of the step. `within_reach` leaves out
// the triangles that the motion cannot touch. `guess`, a triangle that may well be the one, is looked at
// first: then the others are ruled out early.
template <class Surface, class Real>
SurfacePoint<Real> closest_on_surface(Surface& surface, const Vec3<Real>& point, Real s,
                                      const TipMotion<Real>& motion, Search search, std::uint32_t guess = 0) {
  SurfacePoint<Real> best{};
  Real best_squared = 0, best_distance = 0;
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t t = i == 0 ? guess : i == guess ? 0 : i;
    if (search == Search::within_reach && !surface.may_touch(t, motion.from_m, motion.to_m, motion.radius_m))
      continue;
    const auto x = corners_at(surface, t, s);
    // The triangle lies in a ball about its first corner: most are ruled out by that.
    const Vec3<Real> ab = x[1] - x[0], ac = x[2] - x[0], ap = point - x[0];
    if (best.found) {
      const Real reach = std::sqrt(std::max(dot(ab, ab), dot(ac, ac))) + best_distance;
      if (dot(ap, ap) >= reach * reach) continue;
    }
    const auto nearest = closest_point(point, x[0], x[1], x[2]);
    const Vec3<Real> offset = point - nearest.position;
    const Real squared = dot(offset, offset);
    if (best.found && squared >= best_squared) continue;
    best.found = true;
    best_squared = squared;
    best_distance = std::sqrt(squared);
    best.triangle = t;
    best.barycentric = nearest.barycentric;
    best.position_m = nearest.position;
  }
  if (!best.found) return best;
  best.at_border = on_border(surface, best.triangle, best.barycentric);
  const bool behind = is_behind(surface, best.triangle, best.barycentric, point - best.position_m, s);
  best.distance_m = behind ? -best_distance : best_distance;
  return best;
}

}  // namespace palpate::contact_detail
