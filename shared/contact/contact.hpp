// Frictional contact of the tip with a moving triangulated surface: collision within a step, stick, slip,
// separation. The same code runs on the microcontroller (float, local model) and on the host (double, full
// body). Source: Jacobs, Fu, Cavusoglu 2010, sections 4.1 and 4.2; deviations are in docs/architecture.md,
// "Contact".
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "shared/contact/ball.hpp"
#include "shared/contact/collision.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/contact_surface.hpp"
#include "shared/contact/coulomb.hpp"
#include "shared/contact/fold.hpp"
#include "shared/contact/slide.hpp"
#include "shared/contact/surface_point.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// A tip that is inside the body without having passed its surface touches the closest point of it, at first
// without force, and is pushed out: the surface is drawn towards it at this speed (5 mm in a quarter of a
// second, slower than a hand that lets go moves) wherever the pressing force in that step is at most the
// bound (felt well, and held back by two fingers).
inline constexpr double kPushOut_m_s = 0.02;
inline constexpr double kPushOut_N = 1.0;

// Beyond the border of the surface that is known here, the plane of the contact goes on, carried by the
// border's point: level for this part of the border triangle's longest edge, then down at 45 degrees, and no
// further than the second part. A local model ends where the full body goes on; its next one holds the place.
inline constexpr double kLevelOverhang = 0.5;
inline constexpr double kLargestOverhang = 2.0;

// How fast the part beyond the border may change, of the tip's motion: along the border it changes as fast as
// the tip moves; twice, for the border's own motion.
inline constexpr double kOverhangChange = 2.0;

namespace contact_detail {

template <class Surface, class Real>
Real longest_edge_m(Surface& surface, std::uint32_t triangle) {
  const auto x = corners_at(surface, triangle, Real(1));
  return std::max({norm(x[1] - x[0]), norm(x[2] - x[1]), norm(x[0] - x[2])});
}

template <class Real>
Vec3<Real> tangential(const Vec3<Real>& v, const Vec3<Real>& normal) {
  return v - normal * dot(normal, v);
}

// How far the plane beyond the border has gone down, `overhang_m` from the border.
template <class Real>
Real fall_m(Real overhang_m, Real edge_m) {
  const Real beyond_m = overhang_m - static_cast<Real>(kLevelOverhang) * edge_m;
  return beyond_m > 0 ? beyond_m : Real(0);
}

template <class Real>
void release(ContactState<Real>& state, bool outside) {
  state.mode = ContactMode::free;
  state.stretch_m = state.overhang_m = {};
  state.inset_m = 0;
  if (!outside) state.height_m = 0;
  state.at_border = false;
  state.outside = outside;
}

// The contact point goes to where the tip is, but for stretch and inset. `moved_m`: of the tip in this step.
// A contact that has stuck beyond the border, or begun askew inside, may not be at the surface's closest
// place: over a smooth surface it goes there as the tip moves, for a leap would be felt. Flat triangles are
// left with a blow at any edge.
template <class Surface, class Real>
void follow(Surface& surface, ContactState<Real>& state, const Vec3<Real>& tip, Real moved_m, Real smooth) {
  const Vec3<Real> aim = tip - state.stretch_m + state.normal * state.inset_m;
  const auto triangle = state.triangle;
  const Vec3<Real> barycentric = state.barycentric, before = state.overhang_m;
  const Real height_m = state.height_m;
  const auto go_to = [&](const Vec3<Real>& place) {
    const Vec3<Real> short_m = slide(surface, state, place, smooth);
    return state.at_border ? tangential(short_m, state.normal) : Vec3<Real>{};
  };
  state.overhang_m = go_to(aim);
  const Vec3<Real> change = state.overhang_m - before;
  const Real most = static_cast<Real>(kOverhangChange) * moved_m, wanted = norm(change);
  if (wanted > most && surface.kind() == SurfaceKind::smooth) {
    const Vec3<Real> kept = before + change * (most / wanted);
    state.triangle = triangle;
    state.barycentric = barycentric;
    state.height_m = height_m;
    state.overhang_m = kept + go_to(aim - kept);
  }
  if (state.overhang_m == Vec3<Real>{}) return;
  if (norm(state.overhang_m) >
      static_cast<Real>(kLargestOverhang) * longest_edge_m<Surface, Real>(surface, state.triangle))
    release(state, false);
}

}  // namespace contact_detail

// Advances surface and contact by one step of the surface, in which the tip's centre moves from `from` to
// `to`. Afterwards state.force_N is the force of the tip on the body during the step.
template <ContactSurface Surface>
void step_contact(Surface& surface, ContactState<typename Surface::Real>& state,
                  const ContactLaw<typename Surface::Real>& law, const Vec3<typename Surface::Real>& from,
                  const Vec3<typename Surface::Real>& to) {
  namespace detail = contact_detail;
  using Real = typename Surface::Real;
  ContactMode previous = state.mode;
  state.force_N = {};
  auto meeting = detail::Meeting::none;
  if (state.mode == ContactMode::free) {
    const Nearness nearness = surface.nearness(from, to, law.tip_radius_m + std::fabs(state.height_m));
    surface.advance();
    if (nearness == Nearness::near)
      meeting = detail::find_meeting(surface, state, detail::TipMotion<Real>{from, to, law.tip_radius_m});
    if (nearness == Nearness::far) {
      state.outside = false;
      state.height_m = 0;
    }
    if (meeting == detail::Meeting::none) return;
    previous = ContactMode::stick;
  } else {
    surface.prepare(state.triangle);
    surface.advance();
  }

  // The plane of contact is that of the surface at the start of the step: without the contact force, which is
  // not known yet, the surface would spring back within the step and tilt.
  detail::BallNormal<Real> facing{{}, 1};
  if (law.tip_radius_m > 0) {
    Vec3<Real> offset{};
    if (meeting == detail::Meeting::collision) {
      offset = state.normal * law.tip_radius_m;
    } else if (meeting == detail::Meeting::none && !state.at_border && !(state.inset_m > 0) &&
               state.overhang_m == Vec3<Real>{}) {
      const auto x = detail::corners_at(surface, state.triangle, Real(0));
      offset = from - state.stretch_m -
               (x[0] * state.barycentric.x + x[1] * state.barycentric.y + x[2] * state.barycentric.z);
    }
    facing = detail::ball_normal(surface, state, offset, law.tip_radius_m);
  } else {
    facing.normal = surface.normal_before(state.triangle, state.barycentric);
  }
  const Vec3<Real> normal = detail::lean(surface, state, facing.normal, to - from);
  state.normal = normal;
  if (meeting == detail::Meeting::inside) {
    const auto x = detail::corners_at(surface, state.triangle, Real(0));
    const Vec3<Real> open =
        from - normal * law.tip_radius_m -
        (x[0] * state.barycentric.x + x[1] * state.barycentric.y + x[2] * state.barycentric.z);
    state.inset_m = std::max(-dot(normal, open), Real(0));
    state.overhang_m = detail::tangential(open, normal);
  }
  const auto response = surface.respond(state.triangle, state.barycentric);
  const CouplingStep<Real> coupling(law.coupling, static_cast<Real>(surface.step_s()));
  const Mat3<Real> compliance =
      response.compliance_m_N + Mat3<Real>::identity(coupling.compliance_m_N + response.skin_m_N);
  const auto solve_for = [&](const Vec3<Real>& gap) {
    return solve_coulomb(gap - state.stretch_m * coupling.memory, compliance, normal,
                         surface.friction(state.triangle), previous);
  };

  const Real moved_m = norm(to - from);
  const bool beyond_border = state.at_border || !(state.inset_m > 0 || state.overhang_m == Vec3<Real>{});
  const Real swung_m = dot(normal, state.overhang_m);
  const Vec3<Real> overhang = state.overhang_m - normal * swung_m;
  if (beyond_border && surface.kind() == SurfaceKind::smooth && !(state.inset_m > 0)) {
    // The normal has turned under a tip that is far from the contact point. The plane does not swing with it:
    // what it would rise or sink at the tip is height.
    state.height_m += swung_m;
    state.overhang_m = overhang;
  }
  const Vec3<Real> target =
      to + (to - from) * surface.target_extrapolation() - normal * (law.tip_radius_m + state.height_m);
  Vec3<Real> gap = target - overhang + normal * state.inset_m - response.free_m;
  if (beyond_border)
    gap += normal *
           detail::fall_m(norm(overhang), detail::longest_edge_m<Surface, Real>(surface, state.triangle));
  ContactForce<Real> solution{};
  if (surface.kind() == SurfaceKind::flat && !beyond_border && !(state.inset_m > 0)) {
    const auto fold =
        detail::solve_in_fold(surface, state.triangle, state.barycentric, normal, law.tip_radius_m,
                              gap - state.stretch_m * coupling.memory, compliance, previous);
    solution = fold.contact;
    state.normal = fold.normal;
  } else {
    solution = solve_for(gap);
  }
  if (state.inset_m > 0) {
    const Real drawn_m =
        std::min(state.inset_m, static_cast<Real>(kPushOut_m_s) * static_cast<Real>(surface.step_s()));
    const auto drawn = solve_for(gap - normal * drawn_m);
    if (-dot(normal, drawn.force_N) <= static_cast<Real>(kPushOut_N)) {
      solution = drawn;
      gap = gap - normal * drawn_m;
      state.inset_m -= drawn_m;
    }
  }

  state.mode = solution.mode;
  if (solution.mode == ContactMode::free) {
    const Real gap_n = dot(normal, gap);
    if (meeting == detail::Meeting::collision) {
      // Passed aslant close to an edge, the surface may lie behind the tip and the plane of the place that
      // was hit in front of it: the contact goes to where the tip is now, and presses from the next step on.
      state.mode = ContactMode::slip;
      detail::follow(surface, state, to, moved_m, facing.smooth);
    } else if (gap_n >= 0 && gap_n < state.inset_m) {
      // The tip has gone outward by itself, and is still inside: it need not be pushed that far any more.
      state.mode = ContactMode::slip;
      state.stretch_m = {};
      state.inset_m -= gap_n;
      detail::follow(surface, state, to, moved_m, facing.smooth);
    } else if (coupling.yields() && gap_n < 0) {
      // A damper may lose its hold while the tip is still behind the surface: it stays in contact, without
      // force.
      state.mode = ContactMode::slip;
      state.stretch_m = normal * gap_n;
      detail::follow(surface, state, to, moved_m, facing.smooth);
    } else {
      detail::release(state, !beyond_border);
    }
    return;
  }
  state.force_N = solution.force_N;
  state.stretch_m = coupling.stretch_m(state.stretch_m, solution.force_N);
  surface.apply(state.triangle, state.barycentric, solution.force_N);
  // The skin's stretch stays, too: without it friction would be let go in each slip.
  if (solution.mode == ContactMode::slip)
    detail::follow(surface, state, to - solution.force_N * response.skin_m_N, moved_m, facing.smooth);
}

}  // namespace palpate
