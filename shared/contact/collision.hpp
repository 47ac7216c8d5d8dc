// When and where the tip meets a moving surface within a step (Jacobs, Fu, Cavusoglu 2010, section 4.1).
#pragma once

#include <algorithm>
#include <cstdint>

#include "shared/contact/closest_point.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/contact_surface.hpp"
#include "shared/contact/surface_point.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// Halvings of the step in search of the time of collision: 1/256 of a step.
inline constexpr int kCollisionBisections = 8;

namespace contact_detail {

enum class Meeting : std::uint8_t {
  none,
  collision,  // state holds the first contact point
  inside      // the tip has begun the step behind the surface, and was not seen to pass it: the closest point
};

template <class Real>
struct Crossing {
  bool found = false;
  std::uint32_t triangle = 0;
  Real fraction = 1;  // of the step: just after it
};

// Height of the tip's centre over a triangle's plane at fraction s of the step, times twice the area.
template <class Surface, class Real>
Real height_over(Surface& surface, std::uint32_t triangle, const TipMotion<Real>& motion, Real s) {
  const auto x = corners_at(surface, triangle, s);
  return dot(lerp(motion.from_m, motion.to_m, s) - x[0], cross(x[1] - x[0], x[2] - x[0]));
}

// The first triangle that the tip's centre passes from front to back; all move in straight lines. The place
// where it passes the plane is known to a 256th of the motion: within that of the triangle counts, so that
// nothing slips through between two triangles.
template <class Surface, class Real>
Crossing<Real> first_crossing(Surface& surface, const TipMotion<Real>& motion) {
  constexpr Real kResolution = Real(1) / (1 << kCollisionBisections);
  constexpr Real kRounding = static_cast<Real>(1e-5);  // of a triangle's size, in single precision
  Crossing<Real> first{};
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t t = 0; t < count; ++t) {
    if (!surface.may_touch(t, motion.from_m, motion.to_m, motion.radius_m)) continue;
    if (!(height_over(surface, t, motion, Real(1)) < 0)) continue;
    if (height_over(surface, t, motion, Real(0)) < 0) continue;
    Real low = 0, high = 1;
    for (int i = 0; i < kCollisionBisections; ++i) {
      const Real middle = (low + high) * Real(0.5);
      (height_over(surface, t, motion, middle) < 0 ? high : low) = middle;
    }
    if (first.found && high >= first.fraction) continue;
    const auto x = corners_at(surface, t, high), before = corners_at(surface, t, Real(0)),
               after = corners_at(surface, t, Real(1));
    Real moved = norm(motion.to_m - motion.from_m), size = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      moved = std::max(moved, norm(after[c] - before[c]));
      size = std::max(size, norm(x[c] - x[(c + 1) % 3]));
    }
    const Vec3<Real> tip = lerp(motion.from_m, motion.to_m, high);
    const Real miss = norm(tip - closest_point(tip, x[0], x[1], x[2]).position);
    // Tip and triangle may both move.
    if (miss <= Real(2) * moved * kResolution + size * kRounding) first = {true, t, high};
  }
  return first;
}

// Looks for the tip's meeting with the surface in the step just taken.
template <class Surface, class Real>
Meeting find_meeting(Surface& surface, ContactState<Real>& state, const TipMotion<Real>& motion) {
  const Real radius_m = motion.radius_m;
  const auto touch = [&](const SurfacePoint<Real>& point) {
    state.triangle = point.triangle;
    state.barycentric = point.barycentric;
  };
  if (!state.outside) {
    const auto start = closest_on_surface(surface, motion.from_m, Real(0), motion, Search::everywhere);
    if (!start.found || start.at_border) return Meeting::none;
    if (start.distance_m < radius_m) {
      touch(start);
      return Meeting::inside;
    }
    state.outside = true;
  }
  const Crossing<Real> crossing = first_crossing(surface, motion);
  std::uint32_t triangle = crossing.triangle;
  if (!crossing.found) {
    const auto end = closest_on_surface(surface, motion.to_m, Real(1), motion, Search::within_reach);
    // Beside the part of the surface that is known here, the tip may go anywhere.
    if (end.found && end.at_border) state.outside = false;
    if (!end.found || end.at_border) return Meeting::none;
    if (end.distance_m >= radius_m) {
      surface.note_clearance(end.distance_m - radius_m);
      return Meeting::none;
    }
    triangle = end.triangle;
    touch(end);
  }
  // When did the tip pass the plane of that triangle? Both move in straight lines.
  Real low = 0, high = crossing.fraction;
  for (int i = 0; i < kCollisionBisections; ++i) {
    const Real middle = (low + high) * Real(0.5);
    const auto x = corners_at(surface, triangle, middle);
    const Vec3<Real> normal = normalized(cross(x[1] - x[0], x[2] - x[0]));
    (dot(lerp(motion.from_m, motion.to_m, middle) - x[0], normal) < radius_m ? high : low) = middle;
  }
  const auto there =
      closest_on_surface(surface, lerp(motion.from_m, motion.to_m, high), high, motion, Search::within_reach);
  if (crossing.found || !there.at_border) touch(there);
  return Meeting::collision;
}

}  // namespace contact_detail
}  // namespace palpate
