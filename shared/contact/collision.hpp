// When and where the tip meets a moving surface within a step (Jacobs, Fu, Cavusoglu 2010, section 4.1).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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
  collision,  // state holds the first contact point, and as normal the direction from there to a sphere's
              // centre; zero where it is not known
  inside      // the tip has begun the step behind the surface, and was not seen to pass it: the closest point
};

template <class Real>
struct Crossing {
  bool found = false;
  std::uint32_t triangle = 0;
  Real fraction = 1;  // of the step: just after it
};

// Height of the tip over the plane of a triangle, times twice its area.
template <class Real>
Real height_over(const Vec3<Real>& tip, const std::array<Vec3<Real>, 3>& x) {
  return dot(tip - x[0], cross(x[1] - x[0], x[2] - x[0]));
}

// The first triangle that the tip's centre passes from front to back; all move in straight lines. The place
// where it passes the plane is known to a 256th of the motion: within that of the triangle counts, so that
// nothing slips through between two triangles.
template <class Surface, class Real>
Crossing<Real> first_crossing(Surface& surface, const TipMotion<Real>& motion) {
  constexpr Real kResolution = Real(1) / (1 << kCollisionBisections);
  constexpr Real kRounding = static_cast<Real>(1e-5);  // of a triangle's size, in single precision
  // Of the motion: how far the place of passing may be from where heights that fall evenly would have it. A
  // triangle that turns by half a right angle in a step does not make it more.
  constexpr Real kUneven = Real(0.25);
  Crossing<Real> first{};
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t t = 0; t < count; ++t) {
    if (!surface.may_touch(t, motion.from_m, motion.to_m, motion.radius_m)) continue;
    const auto after = corners_at(surface, t, Real(1));
    const Real end = height_over(motion.to_m, after);
    if (!(end < 0)) continue;
    const auto before = corners_at(surface, t, Real(0));
    const Real start = height_over(motion.from_m, before);
    if (start < 0) continue;
    std::array<Vec3<Real>, 3> x{};
    Vec3<Real> tip{};
    const auto move_to = [&](Real s) {
      for (std::size_t c = 0; c < 3; ++c) x[c] = lerp(before[c], after[c], s);
      tip = lerp(motion.from_m, motion.to_m, s);
    };
    const auto miss = [&] { return norm(tip - closest_point(tip, x[0], x[1], x[2]).position); };
    Real moved = norm(motion.to_m - motion.from_m);
    for (std::size_t c = 0; c < 3; ++c) moved = std::max(moved, norm(after[c] - before[c]));
    move_to(start / (start - end));
    const Vec3<Real> ab = x[1] - x[0], ac = x[2] - x[0], ap = tip - x[0];
    const Real size = std::sqrt(std::max(dot(ab, ab), dot(ac, ac)));
    const Real reach = size + kUneven * moved;
    if (dot(ap, ap) > reach * reach || miss() > kUneven * moved + size * kRounding) continue;
    Real low = 0, high = 1;
    for (int i = 0; i < kCollisionBisections; ++i) {
      const Real middle = (low + high) * Real(0.5);
      move_to(middle);
      (height_over(tip, x) < 0 ? high : low) = middle;
    }
    if (first.found && high >= first.fraction) continue;
    move_to(high);
    // Tip and triangle may both move.
    if (miss() <= Real(2) * moved * kResolution + size * kRounding) first = {true, t, high};
  }
  return first;
}

// Could the tip have passed the surface on its way to a place outside? Where it passes a triangle the two are
// in one place; from there on the tip goes no further than in the whole step, and no point of the triangle
// further than its corners: the tip ends no further from the triangle, nor from the closest one, than the
// sum.
template <class Surface, class Real>
bool could_have_crossed(Surface& surface, const TipMotion<Real>& motion, const SurfacePoint<Real>& end) {
  const Real left_m = end.distance_m - norm(motion.to_m - motion.from_m);
  if (left_m <= 0) return true;
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t t = 0; t < count; ++t)
    for (const std::uint32_t node : surface.corners(t)) {
      const Vec3<Real> moved = surface.position(node) - surface.position_before(node);
      if (dot(moved, moved) >= left_m * left_m) return true;
    }
  return false;
}

// Looks for the tip's meeting with the surface in the step just taken. A tip that has just left a smooth
// surface meets it again at the height it had, and in the same direction; once further away from it than
// that, it has forgotten both.
template <class Surface, class Real>
Meeting find_meeting(Surface& surface, ContactState<Real>& state, const TipMotion<Real>& tip_motion) {
  const Vec3<Real> height_m = state.normal * state.height_m;
  const TipMotion<Real> motion{tip_motion.from_m - height_m, tip_motion.to_m - height_m, tip_motion.radius_m};
  const Real radius_m = motion.radius_m;
  const auto touch = [&](const SurfacePoint<Real>& point) {
    state.triangle = point.triangle;
    state.barycentric = point.barycentric;
  };
  std::uint32_t guess = 0;
  if (!state.outside) {
    const auto start = closest_on_surface(surface, motion.from_m, Real(0), motion, Search::everywhere);
    if (!start.found || start.at_border) return Meeting::none;
    if (start.distance_m < radius_m) {
      touch(start);
      return Meeting::inside;
    }
    state.outside = true;
    guess = start.triangle;
  }
  const auto end = closest_on_surface(surface, motion.to_m, Real(1), motion, Search::within_reach, guess);
  if (!end.found) return Meeting::none;
  Crossing<Real> crossing{};
  if (could_have_crossed(surface, motion, end)) crossing = first_crossing(surface, motion);
  std::uint32_t triangle = crossing.triangle;
  if (!crossing.found) {
    // Beside the part of the surface that is known here, the tip may go anywhere.
    if (end.at_border) {
      state.outside = false;
      state.height_m = 0;
      return Meeting::none;
    }
    if (end.distance_m >= radius_m) {
      const Real clearance_m = end.distance_m - radius_m, held_m = std::fabs(state.height_m);
      if (clearance_m >= held_m) state.height_m = 0;
      surface.note_clearance(clearance_m >= held_m ? clearance_m - held_m : clearance_m);
      return Meeting::none;
    }
    triangle = end.triangle;
    touch(end);
  }
  // When did the tip pass the plane of that triangle? Both move in straight lines.
  Real low = 0, high = crossing.fraction;
  const bool known = crossing.found && !(radius_m > 0);
  const auto before = corners_at(surface, triangle, Real(0)), after = corners_at(surface, triangle, Real(1));
  for (int i = 0; i < kCollisionBisections && !known; ++i) {
    const Real middle = (low + high) * Real(0.5);
    std::array<Vec3<Real>, 3> x{};
    for (std::size_t c = 0; c < 3; ++c) x[c] = lerp(before[c], after[c], middle);
    const Vec3<Real> normal = normalized(cross(x[1] - x[0], x[2] - x[0]));
    (dot(lerp(motion.from_m, motion.to_m, middle) - x[0], normal) < radius_m ? high : low) = middle;
  }
  const Vec3<Real> tip = lerp(motion.from_m, motion.to_m, high);
  state.normal = {};
  if (crossing.found) {
    state.triangle = triangle;
    state.barycentric = closest_point(tip, lerp(before[0], after[0], high), lerp(before[1], after[1], high),
                                      lerp(before[2], after[2], high))
                            .barycentric;
  } else {
    const auto there = closest_on_surface(surface, tip, high, motion, Search::within_reach, triangle);
    if (!there.at_border) {
      touch(there);
      state.normal = normalized(tip - there.position_m);
    }
  }
  return Meeting::collision;
}

}  // namespace contact_detail
}  // namespace palpate
