// The contact of a flat surface in its folds: where triangles rise beside the one that is touched, the tip
// may stand against several at once.
//
// A single triangle's force would push the tip through its neighbour, and the neighbour's push it back in the
// next step: work that no hand has done (docs/decisions/contact_energy.md). Instead each plane is a
// constraint. With f the force of the tip on the body and s = gap - compliance f the tip's way from the
// contact point, for each plane i of normal n_i, h_i below the contact point:
//   n_i.s + h_i >= 0,   f = sum of u_i (mu d_i - n_i),   u_i >= 0,   u_i (n_i.s + h_i) = 0
// with d_i the direction of s in plane i; where s = 0 it sticks, by any force of the sum of the friction
// cones.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "shared/contact/contact_surface.hpp"
#include "shared/contact/coulomb.hpp"
#include "shared/contact/surface_point.hpp"
#include "shared/math/linear.hpp"

namespace palpate::contact_detail {

// Those of the triangle that is touched and of five around it; more are not within reach of a step but close
// to a node, where further ones are left out.
inline constexpr std::uint32_t kMaxFoldPlanes = 6;

// Of the gap: with compliances that differ by less than four times between directions no way is longer.
inline constexpr double kFoldReach = 3.0;

template <class Real>
struct FoldPlane {
  Vec3<Real> normal{};  // unit, outward
  Real height_m = 0;    // of the contact point over it; >= 0
};

template <class Real>
struct Fold {
  std::array<FoldPlane<Real>, kMaxFoldPlanes> plane{};  // first the contact point's own, of height 0
  std::uint32_t count = 0;
};

template <class Real>
struct FoldForce {
  ContactForce<Real> contact{};
  Vec3<Real> normal{};  // unit: the direction in which the planes press together
};

// The planes of the triangle and of those beside it or around its nearest node that rise from it and do not
// cut it, at the start of the newest step; none that the contact point is further above than `reach_m`.
// `touching`: the normal of the contact; a sphere's over a sharp edge is not the triangle's.
template <class Surface, class Real>
Fold<Real> fold_at(Surface& surface, std::uint32_t triangle, const Vec3<Real>& barycentric,
                   const Vec3<Real>& touching, Real radius_m, Real reach_m) {
  constexpr Real kRounding = static_cast<Real>(1e-3);  // of the larger height: two triangles share an edge
  Fold<Real> fold{};
  const auto x = corners_at(surface, triangle, Real(0));
  const Vec3<Real> point = x[0] * barycentric.x + x[1] * barycentric.y + x[2] * barycentric.z;
  const Vec3<Real> own = surface.normal_before(triangle, barycentric);
  fold.plane[fold.count++] = {touching, Real(0)};
  const auto add = [&](std::uint32_t other) {
    if (fold.count == kMaxFoldPlanes) return;
    const auto y = corners_at(surface, other, Real(0));
    const Vec3<Real> normal = surface.normal_before(other, barycentric);
    // A sphere touches it earlier than its lowest point does.
    const Real height_m = dot(normal, point - y[0]) - radius_m * (1 - dot(touching, normal));
    if (height_m > reach_m) return;
    Real rise_m = 0, above_m = 0, below_m = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      rise_m = std::max(rise_m, dot(own, y[c] - x[0]));
      above_m = std::max(above_m, dot(normal, x[c] - y[0]));
      below_m = std::max(below_m, dot(normal, y[0] - x[c]));
    }
    if (rise_m > 0 && below_m < above_m * kRounding)
      fold.plane[fold.count++] = {normal, std::max(height_m, Real(0))};
  };
  std::array<std::int32_t, 3> beside{};
  for (std::uint32_t c = 0; c < 3; ++c) {
    beside[c] = surface.neighbour(triangle, c);
    if (beside[c] != kNoTriangle) add(static_cast<std::uint32_t>(beside[c]));
  }
  std::uint32_t node = barycentric.x > barycentric.y ? 0u : 1u;
  if (barycentric.z > barycentric[node]) node = 2;
  auto around = static_cast<std::int32_t>(triangle);
  for (int i = 0; i < kMaxTrianglesAround; ++i) {
    around = next_around(surface, static_cast<std::uint32_t>(around), node);
    if (around == kNoTriangle || around == static_cast<std::int32_t>(triangle)) break;
    if (std::find(beside.begin(), beside.end(), around) == beside.end())
      add(static_cast<std::uint32_t>(around));
  }
  return fold;
}

// Looks for the planes that hold the tip: one, two or three of them; the arguments are solve_coulomb's. Where
// none will do, which friction may cause, the tip sticks for this step, whatever the cones; where that would
// pull, the contact point's own plane holds it alone.
template <class Real>
class FoldSolver {
 public:
  FoldSolver(const Vec3<Real>& gap_m, const Mat3<Real>& compliance_m_N, const Fold<Real>& fold,
             const Friction<Real>& friction, ContactMode previous)
      : gap_m_(gap_m),
        compliance_m_N_(compliance_m_N),
        fold_(fold),
        friction_(friction),
        mu_(previous == ContactMode::slip ? friction.kinetic_coefficient : friction.static_coefficient),
        rounding_m_(static_cast<Real>(1e-5) * norm(gap_m)),
        previous_(previous) {}

  [[nodiscard]] FoldForce<Real> solve() {
    const std::uint32_t n = fold_.count;
    for (std::uint32_t i = 0; i < n; ++i)
      if (one(i)) return found_;
    for (std::uint32_t i = 0; i < n; ++i)
      for (std::uint32_t j = i + 1; j < n; ++j)
        if (two(i, j)) return found_;
    for (std::uint32_t i = 0; i < n; ++i)
      for (std::uint32_t j = i + 1; j < n; ++j)
        for (std::uint32_t k = j + 1; k < n; ++k)
          if (three(i, j, k)) return found_;
    Vec3<Real> force{};
    if (palpate::solve(compliance_m_N_, gap_m_, force) && dot(force, fold_.plane[0].normal) < 0)
      (void)take(ContactMode::stick, force, fold_.plane[0].normal);
    else
      (void)one(0);
    return found_;
  }

 private:
  static constexpr Real kParallel = static_cast<Real>(1e-6);   // squared sine between planes without an edge
  static constexpr int kDirectionHalvings = 20;                // of a half turn
  static constexpr Real kAgrees = static_cast<Real>(0.99998);  // squared cosine; 0.26 degrees
  // A plane may pull by this share of what both press and of the coefficient: with friction's direction, that
  // is not known better.
  static constexpr Real kPull = static_cast<Real>(0.02);
  // Friction may leave the sum of two cones by a hundredth of itself: projections to them in turn come as
  // close.
  static constexpr int kConeProjections = 20;
  static constexpr Real kConeExcess = static_cast<Real>(0.01);

  bool take(ContactMode mode, const Vec3<Real>& force_N, const Vec3<Real>& pressing) {
    found_ = {{mode, force_N}, normalized(pressing)};
    return true;
  }

  // Is the tip, gone s from the contact point, in front of all planes but those that hold it (a bit each)?
  [[nodiscard]] bool in_front(const Vec3<Real>& s, std::uint32_t holding) const {
    for (std::uint32_t p = 0; p < fold_.count; ++p)
      if ((holding >> p & 1u) == 0 && dot(fold_.plane[p].normal, s) + fold_.plane[p].height_m < -rounding_m_)
        return false;
    return true;
  }

  // Force per pressing force of plane i, on the body by a tip that goes along `way`.
  [[nodiscard]] Vec3<Real> push(std::uint32_t i, const Vec3<Real>& way) const {
    const Vec3<Real>& n = fold_.plane[i].normal;
    return normalized(way - n * dot(n, way)) * friction_.kinetic_coefficient - n;
  }

  // The force of plane i's friction cone nearest to `force`.
  [[nodiscard]] Vec3<Real> in_cone(std::uint32_t i, const Vec3<Real>& force) const {
    const Vec3<Real>& n = fold_.plane[i].normal;
    const Real pressing = -dot(n, force);
    const Vec3<Real> tangential = force + n * pressing;
    const Real drag = norm(tangential);
    if (drag <= mu_ * pressing) return force;
    if (mu_ * drag <= -pressing) return {};
    const Real nearest = (pressing + mu_ * drag) / (1 + mu_ * mu_);
    return tangential * (mu_ * nearest / drag) - n * nearest;
  }

  [[nodiscard]] bool in_cones(std::uint32_t i, std::uint32_t j, const Vec3<Real>& force) const {
    Vec3<Real> of_i{}, of_j{};
    for (int k = 0; k < kConeProjections; ++k) {
      of_i = in_cone(i, force - of_j);
      of_j = in_cone(j, force - of_i);
    }
    return norm(force - of_i - of_j) <= norm(force) * (kConeExcess * mu_);
  }

  bool one(std::uint32_t i) {
    const auto& [n, height_m] = fold_.plane[i];
    const auto f = solve_coulomb(gap_m_ + n * height_m, compliance_m_N_, n, friction_, previous_);
    found_ = {f, n};
    const Vec3<Real> s = f.mode == ContactMode::stick ? n * -height_m : gap_m_ - compliance_m_N_ * f.force_N;
    return in_front(s, f.mode == ContactMode::free ? 0u : 1u << i);
  }

  // In the edge between two planes, however far from it the contact point still is.
  bool two(std::uint32_t i, std::uint32_t j) {
    const auto& [a, height_a_m] = fold_.plane[i];
    const auto& [b, height_b_m] = fold_.plane[j];
    const Vec3<Real> edge = cross(a, b);
    const Real cosine = dot(a, b), sine_squared = dot(edge, edge);
    if (!(sine_squared > kParallel)) return false;
    const std::uint32_t holding = 1u << i | 1u << j;
    const Vec3<Real> along = edge * (Real(1) / std::sqrt(sine_squared));
    const Vec3<Real> to_edge =
        (a * (height_b_m * cosine - height_a_m) + b * (height_a_m * cosine - height_b_m)) *
        (Real(1) / sine_squared);
    const Real to_edge_m = norm(to_edge);
    Vec3<Real> force{}, s{};
    Real ua = 0, ub = 0;
    if (to_edge_m <= Real(10) * rounding_m_) {
      if (!palpate::solve(compliance_m_N_, gap_m_ - to_edge, force)) return false;
      const Real pa = -dot(a, force), pb = -dot(b, force);
      ua = (pa - cosine * pb) / sine_squared;
      ub = (pb - cosine * pa) / sine_squared;
      const bool pressed = ua >= 0 && ub >= 0 && std::fabs(dot(along, force)) <= mu_ * (ua + ub);
      if ((pressed || in_cones(i, j, force)) && in_front(to_edge, holding))
        return take(ContactMode::stick, force, a * ua + b * ub);
    }
    // It slides to the edge, and along it: friction turns with the direction between the two, which is found
    // by halving.
    const Vec3<Real> across = to_edge_m > 0 ? to_edge * (Real(1) / to_edge_m) : normalized(a * cosine - b);
    const Real gap_a_m = dot(a, gap_m_) + height_a_m, gap_b_m = dot(b, gap_m_) + height_b_m;
    Real low = -1, high = 1;
    for (int k = 0; k < kDirectionHalvings; ++k) {
      const Real share = (low + high) * Real(0.5), rest = 1 - std::fabs(share);
      const Vec3<Real> way = across * rest + along * share;
      const Vec3<Real> push_a = push(i, way), push_b = push(j, way);
      const Vec3<Real> ca = compliance_m_N_ * push_a, cb = compliance_m_N_ * push_b;
      const Real aa = dot(a, ca), ab = dot(a, cb), ba = dot(b, ca), bb = dot(b, cb);
      const Real determinant = aa * bb - ab * ba;
      if (!(determinant > 0)) return false;  // wedged, as in solve_coulomb
      ua = (bb * gap_a_m - ab * gap_b_m) / determinant;
      ub = (aa * gap_b_m - ba * gap_a_m) / determinant;
      force = push_a * ua + push_b * ub;
      s = gap_m_ - compliance_m_N_ * force;
      const Real agrees = dot(s, way);
      if (!(friction_.kinetic_coefficient > 0)) break;
      if (agrees > 0 && agrees * agrees >= kAgrees * dot(s, s) * dot(way, way)) break;
      (dot(along, s) * rest > to_edge_m * share ? low : high) = share;
    }
    const Real pull = kPull * friction_.kinetic_coefficient * (ua + ub);
    if (!(std::min(ua, ub) >= -pull) || !in_front(s, holding)) return false;
    return take(ContactMode::slip, force, a * ua + b * ub);
  }

  // In the corner of three planes.
  bool three(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const auto &a = fold_.plane[i], &b = fold_.plane[j], &c = fold_.plane[k];
    const Vec3<Real> bc = cross(b.normal, c.normal), ca = cross(c.normal, a.normal),
                     ab = cross(a.normal, b.normal);
    const Real volume = dot(a.normal, bc);
    if (!(std::fabs(volume) > kParallel)) return false;
    const Vec3<Real> s = (bc * a.height_m + ca * b.height_m + ab * c.height_m) * (Real(-1) / volume);
    if (!in_front(s, 1u << i | 1u << j | 1u << k)) return false;
    // At rest there, the planes' normals alone: inside the sum of their cones.
    const bool rests = norm(s) <= Real(10) * rounding_m_;
    const Vec3<Real> way = rests ? Vec3<Real>{} : s;
    Vec3<Real> force{}, u{};
    if (!palpate::solve(compliance_m_N_, gap_m_ - s, force) ||
        !palpate::solve(transpose(Mat3<Real>{{push(i, way), push(j, way), push(k, way)}}), force, u))
      return false;
    if (!(u.x >= 0 && u.y >= 0 && u.z >= 0)) return false;
    return take(rests ? ContactMode::stick : ContactMode::slip, force,
                a.normal * u.x + b.normal * u.y + c.normal * u.z);
  }

  const Vec3<Real>& gap_m_;
  const Mat3<Real>& compliance_m_N_;
  const Fold<Real>& fold_;
  Friction<Real> friction_;
  Real mu_;
  Real rounding_m_;
  ContactMode previous_;
  FoldForce<Real> found_{};
};

// The contact of a flat surface's point in the newest step.
template <class Surface, class Real>
FoldForce<Real> solve_in_fold(Surface& surface, std::uint32_t triangle, const Vec3<Real>& barycentric,
                              const Vec3<Real>& touching, Real radius_m, const Vec3<Real>& gap_m,
                              const Mat3<Real>& compliance_m_N, ContactMode previous) {
  const Fold<Real> fold = fold_at(surface, triangle, barycentric, touching, radius_m,
                                  static_cast<Real>(kFoldReach) * norm(gap_m));
  return FoldSolver<Real>(gap_m, compliance_m_N, fold, surface.friction(triangle), previous).solve();
}

}  // namespace palpate::contact_detail
