// Frictional contact of the tip with a moving triangulated surface: collision within a step, stick, slip,
// separation. The same code runs on the microcontroller (float, local model) and on the host (double, full
// body). Source: Jacobs, Fu, Cavusoglu 2010, sections 4.1 and 4.2; deviations are in docs/architecture.md,
// "Contact".
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>

#include "shared/contact/closest_point.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/coulomb.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// How a point of the surface answers in the step that is under way.
template <class Real>
struct PointResponse {
  Vec3<Real> free_m{};  // where it ends without a contact force
  Mat3<Real>
      compliance_m_N{};  // its displacement per force on it during the step; symmetric, positive definite
};

inline constexpr std::int32_t kNoTriangle = -1;

// A surface that can be touched. kTargetExtrapolation (in steps): the response is that of position +
// extrapolation * step * velocity at the end of the step; 0 where the surface's own stepping has no sampling
// zero near -1.
template <class S>
concept ContactSurface = requires(S s, const S c, std::uint32_t i, Vec3<typename S::Real> v,
                                  typename S::Real radius) {
  { S::kTargetExtrapolation } -> std::convertible_to<typename S::Real>;
  { c.triangle_count() } -> std::convertible_to<std::uint32_t>;
  { c.step_s() } -> std::convertible_to<typename S::Real>;
  { c.corners(i) } -> std::same_as<std::array<std::uint32_t, 3>>;
  // Across the edge opposite to corner `i` of the triangle; kNoTriangle at the border.
  { c.neighbour(i, i) } -> std::convertible_to<std::int32_t>;
  // Of the material of triangle `i`.
  { c.friction(i) } -> std::same_as<Friction<typename S::Real>>;
  // Cheap test: could a tip of this radius that moves from the first to the second point touch the surface?
  // May say yes too often.
  { s.is_near(v, v, radius) } -> std::same_as<bool>;
  // The tip has ended the newest step this far outside: it cannot touch again before it has come closer.
  {s.note_clearance(radius)};
  // Could triangle `i` be within reach of the same motion? May say yes too often.
  { s.may_touch(i, v, v, radius) } -> std::same_as<bool>;
  // Readies `normal_before` and `position_before` of a triangle for the step to come; is_near does so for
  // all.
  {s.prepare(i)};
  // Node positions at the end and at the start of the newest step.
  { s.position(i) } -> std::same_as<Vec3<typename S::Real>>;
  { s.position_before(i) } -> std::same_as<Vec3<typename S::Real>>;
  // Unit outward normal at a point of triangle `i` at the start of the newest step (surface_kind.hpp).
  { s.normal_before(i, v) } -> std::same_as<Vec3<typename S::Real>>;
  // One step without contact force; then the response of a point; then the force on it.
  {s.advance()};
  { s.respond(i, v) } -> std::same_as<PointResponse<typename S::Real>>;
  {s.apply(i, v, v)};
};

// Halvings of the step in search of the time of collision (section 4.1): 1/256 of a step.
inline constexpr int kCollisionBisections = 8;
// Triangle edges that the contact point may cross in one step: 5 m/s over 1 cm cells at 1 kHz crosses one or
// two.
inline constexpr int kMaxEdgeCrossings = 6;

namespace contact_detail {

template <class Real>
struct SurfacePoint {
  bool found = false;  // the closest point is not on the border of the surface
  std::uint32_t triangle = 0;
  Vec3<Real> barycentric{};
  Real distance_m = 0;  // signed: positive outside
};

template <class Real>
Vec3<Real> lerp(const Vec3<Real>& a, const Vec3<Real>& b, Real s) {
  return a + (b - a) * s;
}

template <class Surface, class Real>
bool on_border(const Surface& surface, std::uint32_t triangle, const Vec3<Real>& barycentric) {
  for (std::uint32_t c = 0; c < 3; ++c)
    if (barycentric[c] == 0 && surface.neighbour(triangle, c) == kNoTriangle) return true;
  return false;
}

// Closest point of the surface to `point`, with nodes at fraction s of the step (0: before, 1: after).
template <class Surface, class Real>
SurfacePoint<Real> closest_on_surface(Surface& surface, const Vec3<Real>& point, Real s,
                                      const Vec3<Real>& from, const Vec3<Real>& to, Real radius_m) {
  SurfacePoint<Real> best{};
  Real best_squared = 0;
  bool any = false;
  const std::uint32_t count = surface.triangle_count();
  for (std::uint32_t t = 0; t < count; ++t) {
    if (!surface.may_touch(t, from, to, radius_m)) continue;
    const auto corner = surface.corners(t);
    Vec3<Real> x[3];
    for (std::uint32_t c = 0; c < 3; ++c) {
      x[c] = s == 1   ? surface.position(corner[c])
             : s == 0 ? surface.position_before(corner[c])
                      : lerp(surface.position_before(corner[c]), surface.position(corner[c]), s);
    }
    // The triangle lies in a ball about its first corner: most are ruled out by that.
    const Vec3<Real> ab = x[1] - x[0], ac = x[2] - x[0], ap = point - x[0];
    if (any) {
      const Real size_squared = std::max(dot(ab, ab), dot(ac, ac));
      const Real to_ball = std::sqrt(dot(ap, ap)) - std::sqrt(size_squared);
      if (to_ball > 0 && to_ball * to_ball >= best_squared) continue;
    }
    const auto nearest = closest_point(point, x[0], x[1], x[2]);
    const Vec3<Real> offset = point - nearest.position;
    const Real squared = dot(offset, offset);
    if (any && squared >= best_squared) continue;
    any = true;
    best_squared = squared;
    best.triangle = t;
    best.barycentric = nearest.barycentric;
    const Real side = dot(offset, cross(ab, ac));
    best.distance_m = side < 0 ? -std::sqrt(squared) : std::sqrt(squared);
  }
  best.found = any && !on_border(surface, best.triangle, best.barycentric);
  return best;
}

// Looks for a collision in the step just taken. True: state holds the first contact point.
template <class Surface, class Real>
bool find_collision(Surface& surface, ContactState<Real>& state, Real radius_m, const Vec3<Real>& from,
                    const Vec3<Real>& to) {
  if (!state.outside) {
    const auto before = closest_on_surface(surface, from, Real(0), from, to, radius_m);
    state.outside = before.found && before.distance_m >= radius_m;
    if (!state.outside) return false;
  }
  auto hit = closest_on_surface(surface, to, Real(1), from, to, radius_m);
  if (!hit.found || hit.distance_m >= radius_m) {
    if (hit.found) surface.note_clearance(hit.distance_m - radius_m);
    return false;
  }
  // When did the tip pass the plane of the triangle that it is behind now? Both move in straight lines.
  const auto corner = surface.corners(hit.triangle);
  Real low = 0, high = 1;
  for (int i = 0; i < kCollisionBisections; ++i) {
    const Real middle = (low + high) * Real(0.5);
    Vec3<Real> x[3];
    for (std::uint32_t c = 0; c < 3; ++c)
      x[c] = lerp(surface.position_before(corner[c]), surface.position(corner[c]), middle);
    const Vec3<Real> normal = normalized(cross(x[1] - x[0], x[2] - x[0]));
    (dot(lerp(from, to, middle) - x[0], normal) < radius_m ? high : low) = middle;
  }
  const auto there = closest_on_surface(surface, lerp(from, to, high), high, from, to, radius_m);
  if (there.found) hit = there;
  state.triangle = hit.triangle;
  state.barycentric = hit.barycentric;
  return true;
}

// Moves the contact point over the surface to where the tip is now, from triangle to triangle.
template <class Surface, class Real>
void slide(Surface& surface, ContactState<Real>& state, const Vec3<Real>& tip) {
  const auto nearest_on = [&](std::uint32_t t) {
    const auto corner = surface.corners(t);
    return closest_point(tip, surface.position(corner[0]), surface.position(corner[1]),
                         surface.position(corner[2]));
  };
  auto best = nearest_on(state.triangle);
  for (int crossing = 0; crossing < kMaxEdgeCrossings; ++crossing) {
    const Vec3<Real> offset = tip - best.position;
    Real best_squared = dot(offset, offset);
    bool moved = false;
    const std::uint32_t here = state.triangle;
    const Vec3<Real> here_barycentric = best.barycentric;
    for (std::uint32_t c = 0; c < 3; ++c) {
      if (here_barycentric[c] != 0) continue;
      const std::int32_t across = surface.neighbour(here, c);
      if (across == kNoTriangle) continue;
      const auto candidate = nearest_on(static_cast<std::uint32_t>(across));
      const Vec3<Real> d = tip - candidate.position;
      if (dot(d, d) < best_squared) {
        best_squared = dot(d, d);
        best = candidate;
        state.triangle = static_cast<std::uint32_t>(across);
        moved = true;
      }
    }
    if (!moved) break;
  }
  state.barycentric = best.barycentric;
  state.at_border = on_border(surface, state.triangle, best.barycentric);
}

}  // namespace contact_detail

// Advances surface and contact by one step of the surface, in which the tip's centre moves from `from` to
// `to`. Afterwards state.force_N is the force of the tip on the body during the step.
template <ContactSurface Surface>
void step_contact(Surface& surface, ContactState<typename Surface::Real>& state,
                  const ContactLaw<typename Surface::Real>& law, const Vec3<typename Surface::Real>& from,
                  const Vec3<typename Surface::Real>& to) {
  using Real = typename Surface::Real;
  ContactMode previous = state.mode;
  state.force_N = {};
  if (state.mode == ContactMode::free) {
    const bool near = surface.is_near(from, to, law.tip_radius_m);
    surface.advance();
    if (!near || !contact_detail::find_collision(surface, state, law.tip_radius_m, from, to)) return;
    previous = ContactMode::stick;
  } else {
    surface.prepare(state.triangle);
    surface.advance();
  }

  // The plane of contact is that of the surface at the start of the step: without the contact force, which is
  // not known yet, the surface would spring back within the step and tilt.
  const Vec3<Real> normal = surface.normal_before(state.triangle, state.barycentric);
  const auto response = surface.respond(state.triangle, state.barycentric);
  const Vec3<Real> target = to + (to - from) * Surface::kTargetExtrapolation - normal * law.tip_radius_m;
  const CouplingStep<Real> coupling(law.coupling, static_cast<Real>(surface.step_s()));
  const Vec3<Real> gap = target - response.free_m;
  const auto solution = solve_coulomb(gap - state.stretch_m * coupling.memory,
                                      response.compliance_m_N + Mat3<Real>::identity(coupling.compliance_m_N),
                                      normal, surface.friction(state.triangle), previous);
  state.mode = solution.mode;
  if (solution.mode == ContactMode::free) {
    // A damper may lose its hold while the tip is still behind the surface: it stays in contact, without
    // force.
    if (coupling.yields() && dot(normal, gap) < 0) {
      state.mode = ContactMode::slip;
      state.normal = normal;
      state.stretch_m = normal * dot(normal, gap);
      contact_detail::slide(surface, state, to - state.stretch_m);
      return;
    }
    state.stretch_m = {};
    state.outside = true;
    state.at_border = false;
    return;
  }
  state.force_N = solution.force_N;
  state.normal = normal;
  state.stretch_m = coupling.stretch_m(state.stretch_m, solution.force_N);
  surface.apply(state.triangle, state.barycentric, solution.force_N);
  if (solution.mode == ContactMode::slip) contact_detail::slide(surface, state, to - state.stretch_m);
}

}  // namespace palpate
