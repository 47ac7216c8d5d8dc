// Contact as the paper writes it, on an unreduced patch: the contact mode `paper`. Source: Jacobs, Fu,
// Cavusoglu 2010, sections 4.1 and 4.2. The operators T, U, P, Q, P~, Q~ of equations (7)-(22) are applied in
// closed form; host/reference builds them as matrices, and both agree to rounding
// (docs/decisions/paper_contact.md).
//
// With w = (alpha, beta, gamma), s = |w|^2 and W the 3m x 3 matrix with blocks w_i I at the triangle's nodes:
//   P = I - W W' / s,  P~ = W W' / s,  Q = I - W n n' W' / s,  Q~ = W n n' W' / s.
// Our readings where the text leaves a choice:
//   (7)       The first rows of T_11 stay as written, so that (9) gives p itself: T is orthogonal up to their
//             length. P, Q, P~ and Q~ do not depend on that.
//   (12)      x(t_c) is advanced with the new velocity. A step without collision is (12) over all of dt.
//   (13)      x is advanced with v(t_c), as written: explicit Euler. (21) and (29) use the new velocity.
//   (15)      f_instr = P~ f is the force of the body on the instrument: f are the body's internal forces.
//   4.1       "pushing the triangle": p is put where the instrument is at the end of the step (its normal
//             part without friction), the other coordinates of (9) unchanged: node i moves by w_i d / s. A
//             contact that persists has t_c = t; it ends when the patch, left to itself, stays behind the
//             instrument.
//   (17)      n is the triangle's normal at t_c, before the push.
//   (27)      is zero where a node has no tangential force.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "shared/contact/closest_point.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

enum class PaperFriction : std::uint8_t {
  sticking,      // section 4.2.1 always
  frictionless,  // section 4.2.2 always
  coulomb        // 4.2.1, or 4.2.3 where the Coulomb test (4) rejects it
};

// What (6), "p' = 0", means.
enum class PaperPointVelocity : std::uint8_t {
  held,    // as written: the contact point has no velocity; the push alone moves it
  carried  // relative to the instrument: the contact point has the instrument's velocity
};

template <class Real>
struct PaperLaw {
  PaperFriction kind = PaperFriction::coulomb;
  Real friction = 0;  // mu of (4); used by `coulomb`
  PaperPointVelocity point = PaperPointVelocity::held;
};

template <class Real>
struct PaperContactState {
  ContactMode mode = ContactMode::free;
  std::uint32_t triangle = 0;       // only with mode != free, as all below but the forces
  Vec3<Real> barycentric{};         // (alpha, beta, gamma) during the last step
  Vec3<Real> normal{};              // n; unit, outward
  Real collision_s = 0;             // dt_c; 0 where the contact persisted
  Vec3<Real> instrument_force_N{};  // of the body on the instrument: (15), (23) or (31)
  // The force that the step's change of momentum takes, sum of f - M (v_new - v(t_c)) / dt', of the body on
  // the instrument. It contains what the equations leave out: bringing the nodes to the constrained velocity.
  Vec3<Real> momentum_force_N{};
};

// An unreduced patch: nodes that all can move, with their masses, and triangles with corners in
// counter-clockwise order seen from outside.
template <class S>
concept PaperPatch = requires(S s, const S c, std::uint32_t i, Vec3<typename S::Real> v) {
  { c.node_count() } -> std::convertible_to<std::uint32_t>;
  { c.triangle_count() } -> std::convertible_to<std::uint32_t>;
  { c.corners(i) } -> std::same_as<std::array<std::uint32_t, 3>>;
  { c.mass_kg(i) } -> std::same_as<typename S::Real>;
  { c.position(i) } -> std::same_as<Vec3<typename S::Real>>;
  { c.velocity(i) } -> std::same_as<Vec3<typename S::Real>>;
  {s.displace(i, v)};  // position += v
  {s.set_velocity(i, v)};
  // F [x; v] for the present state; then the force on each node.
  {s.evaluate_forces()};
  { c.force(i) } -> std::same_as<Vec3<typename S::Real>>;
};

// Halvings of the step in search of the time of collision (section 4.1).
inline constexpr int kPaperBisections = 8;
// How far beside a triangle, in its longest edge, a tip may pass its plane and still hit it: closes the gaps
// between moving triangles that the bisection's resolution leaves.
template <class Real>
inline constexpr Real kPaperEdgeTolerance = Real(1e-3);

namespace paper_detail {

template <class Real>
struct Corners {
  Vec3<Real> x[3];

  [[nodiscard]] Vec3<Real> normal() const { return normalized(cross(x[1] - x[0], x[2] - x[0])); }
  [[nodiscard]] Vec3<Real> at(const Vec3<Real>& w) const { return x[0] * w.x + x[1] * w.y + x[2] * w.z; }
};

// Corners at time t + s: equation (12). Forces must have been evaluated at t.
template <class Patch, class Real>
Corners<Real> corners_at(const Patch& patch, std::uint32_t triangle, Real s) {
  Corners<Real> result;
  const auto corner = patch.corners(triangle);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t n = corner[k];
    const Vec3<Real> velocity = patch.velocity(n) + patch.force(n) * (s / patch.mass_kg(n));
    result.x[k] = patch.position(n) + velocity * s;
  }
  return result;
}

template <class Patch, class Real>
void advance_free(Patch& patch, Real s) {
  for (std::uint32_t n = 0; n < patch.node_count(); ++n) {
    const Vec3<Real> velocity = patch.velocity(n) + patch.force(n) * (s / patch.mass_kg(n));
    patch.set_velocity(n, velocity);
    patch.displace(n, velocity * s);
  }
}

// A contact that persists: the point of a sticking contact stays; a sliding one is what is closest to the
// tip.
template <class Patch, class Real>
void find_contact_point(const Patch& patch, PaperContactState<Real>& state, const Vec3<Real>& tip) {
  if (state.mode == ContactMode::stick) return;
  Real best = 0;
  for (std::uint32_t t = 0; t < patch.triangle_count(); ++t) {
    const Corners<Real> c = corners_at(patch, t, Real(0));
    const TrianglePoint<Real> nearest = closest_point(tip, c.x[0], c.x[1], c.x[2]);
    const Real squared = dot(tip - nearest.position, tip - nearest.position);
    if (t != 0 && squared >= best) continue;
    best = squared;
    state.triangle = t;
    state.barycentric = nearest.barycentric;
  }
}

// The first triangle that the tip passes from outside during the step.
template <class Patch, class Real>
bool find_first_contact(const Patch& patch, PaperContactState<Real>& state, const Vec3<Real>& from,
                        const Vec3<Real>& to, Real step_s) {
  bool found = false;
  for (std::uint32_t t = 0; t < patch.triangle_count(); ++t) {
    const auto outside = [&](Real fraction) {
      const Corners<Real> c = corners_at(patch, t, fraction * step_s);
      return dot(from + (to - from) * fraction - c.x[0], c.normal()) >= 0;
    };
    if (!outside(Real(0)) || outside(Real(1))) continue;
    Real low = 0, high = 1;
    for (int i = 0; i < kPaperBisections; ++i) {
      const Real middle = (low + high) * Real(0.5);
      (outside(middle) ? low : high) = middle;
    }
    if (found && low * step_s >= state.collision_s) continue;
    const Corners<Real> c = corners_at(patch, t, low * step_s);
    const Vec3<Real> tip = from + (to - from) * low, normal = c.normal();
    const TrianglePoint<Real> nearest = closest_point(tip, c.x[0], c.x[1], c.x[2]);
    const Vec3<Real> offset = tip - nearest.position;
    const Vec3<Real> beside = offset - normal * dot(normal, offset);
    const Vec3<Real> ab = c.x[1] - c.x[0], bc = c.x[2] - c.x[1], ca = c.x[0] - c.x[2];
    const Real edge = std::sqrt(std::max({dot(ab, ab), dot(bc, bc), dot(ca, ca)}));
    if (norm(beside) > kPaperEdgeTolerance<Real> * edge) continue;
    found = true;
    state.triangle = t;
    state.barycentric = nearest.barycentric;
    state.collision_s = low * step_s;
  }
  return found;
}

// (25)-(27), (31): the tangential part bounded by mu times the normal part.
template <class Real>
Vec3<Real> sliding_force(const Vec3<Real>& sticking_N, const Vec3<Real>& normal, Real friction) {
  const Vec3<Real> along_normal = normal * dot(normal, sticking_N);
  const Vec3<Real> tangential = sticking_N - along_normal;
  const Real magnitude = norm(tangential);
  if (!(magnitude > 0)) return along_normal;
  return along_normal + tangential * (friction * norm(along_normal) / magnitude);
}

// Coulomb test (4): is a sticking force within the cone?
template <class Real>
bool within_cone(const Vec3<Real>& sticking_N, const Vec3<Real>& normal, Real friction) {
  const Vec3<Real> along_normal = normal * dot(normal, sticking_N);
  return norm(sticking_N - along_normal) <= friction * norm(along_normal);
}

}  // namespace paper_detail

// Advances patch and contact by dt = step_s > 0, in which the instrument moves straight from `from` to `to`
// (section 4.1, Figure 10). Positions are in the patch's frame. The largest stable step is the caller's
// affair: (13) is explicit Euler.
template <PaperPatch Patch>
void step_paper_contact(Patch& patch, PaperContactState<typename Patch::Real>& state,
                        const PaperLaw<typename Patch::Real>& law, const Vec3<typename Patch::Real>& from,
                        const Vec3<typename Patch::Real>& to, typename Patch::Real step_s) {
  using Real = typename Patch::Real;
  using namespace paper_detail;
  state.instrument_force_N = state.momentum_force_N = {};

  // Advance to t + dt; collision; back to the time of collision.
  patch.evaluate_forces();
  bool collided = false;
  if (state.mode != ContactMode::free) {
    state.collision_s = 0;
    find_contact_point(patch, state, from);
    const Corners<Real> end = corners_at(patch, state.triangle, step_s);
    collided = dot(end.normal(), to - end.at(state.barycentric)) < 0;
  } else {
    collided = find_first_contact(patch, state, from, to, step_s);
  }
  if (!collided) {
    advance_free(patch, step_s);
    state.mode = ContactMode::free;
    return;
  }
  if (state.collision_s > 0) advance_free(patch, state.collision_s);
  const Real remaining_s = step_s - state.collision_s;  // dt'

  // Geometric push.
  const Vec3<Real> w = state.barycentric;
  const Real s = dot(w, w);
  const auto corner = patch.corners(state.triangle);
  const Corners<Real> there = corners_at(patch, state.triangle, Real(0));
  const Vec3<Real> n = state.normal = there.normal();
  Vec3<Real> push = to - there.at(w);
  if (law.kind == PaperFriction::frictionless) push = n * dot(n, push);
  for (std::size_t k = 0; k < 3; ++k) patch.displace(corner[k], push * (w[k] / s));

  // Constraint forces.
  patch.evaluate_forces();
  Vec3<Real> sticking{}, drift{};  // P~ f summed over the nodes; W' v(t_c)
  for (std::size_t k = 0; k < 3; ++k) {
    sticking += patch.force(corner[k]) * (w[k] / s);
    drift += patch.velocity(corner[k]) * w[k];
  }
  const bool sticks = law.kind == PaperFriction::sticking ||
                      (law.kind == PaperFriction::coulomb && within_cone(sticking, n, law.friction));
  state.mode = sticks ? ContactMode::stick : ContactMode::slip;
  Vec3<Real> carried_by_instrument{};  // f^ of (27), summed
  if (sticks) {
    state.instrument_force_N = sticking;
  } else if (law.kind == PaperFriction::frictionless) {
    state.instrument_force_N = n * dot(n, sticking);
  } else {
    state.instrument_force_N = carried_by_instrument = sliding_force(sticking, n, law.friction);
  }

  // (13), (21), (29). `lift` is the contact point's velocity after the projection.
  Vec3<Real> lift{}, pushed{};
  if (law.point == PaperPointVelocity::carried) {
    const Vec3<Real> u = (to - from) * (Real(1) / step_s);
    lift = sticks ? u : n * dot(n, u);
    // What the push has already moved.
    pushed = sticks ? drift : (law.kind == PaperFriction::frictionless ? lift : u);
  }
  std::array<Vec3<Real>, 3> new_velocity{};
  Vec3<Real> projected{};  // W' of the unconstrained velocity
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t node = corner[k];
    const Vec3<Real> force = patch.force(node) - carried_by_instrument * w[k];
    new_velocity[k] = patch.velocity(node) + force * (remaining_s / patch.mass_kg(node));
    projected += new_velocity[k] * w[k];
  }
  const Vec3<Real> removed = (sticks ? projected : n * dot(n, projected)) - lift;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t node = corner[k];
    const Vec3<Real> old_velocity = patch.velocity(node);
    new_velocity[k] -= removed * (w[k] / s);
    patch.displace(node, ((sticks ? old_velocity : new_velocity[k]) - pushed * (w[k] / s)) * remaining_s);
    state.momentum_force_N +=
        patch.force(node) - (new_velocity[k] - old_velocity) * (patch.mass_kg(node) / remaining_s);
  }
  for (std::uint32_t node = 0; node < patch.node_count(); ++node) {
    if (node == corner[0] || node == corner[1] || node == corner[2]) continue;
    const Vec3<Real> old_velocity = patch.velocity(node);
    const Vec3<Real> velocity = old_velocity + patch.force(node) * (remaining_s / patch.mass_kg(node));
    patch.displace(node, (sticks ? old_velocity : velocity) * remaining_s);
    patch.set_velocity(node, velocity);
  }
  for (std::size_t k = 0; k < 3; ++k) patch.set_velocity(corner[k], new_velocity[k]);
}

}  // namespace palpate
