// Closest point of a triangle to a point, in barycentric coordinates.
#pragma once

#include "shared/math/linear.hpp"

namespace palpate {

template <class Real>
struct TrianglePoint {
  Vec3<Real> barycentric{};  // weights of corners a, b, c; exactly 0 where the closest point lies on the
                             // opposite edge
  Vec3<Real> position{};
};

// Closest point of triangle abc to p (Ericson, Real-Time Collision Detection, 2005, section 5.1.5): by
// Voronoi regions of corners, edges and face. A degenerate triangle yields one of its corners or edges, never
// NaN.
template <class Real>
TrianglePoint<Real> closest_point(const Vec3<Real>& p, const Vec3<Real>& a, const Vec3<Real>& b,
                                  const Vec3<Real>& c) {
  const Vec3<Real> ab = b - a, ac = c - a, ap = p - a;
  const Real d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {{1, 0, 0}, a};
  const Vec3<Real> bp = p - b;
  const Real d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {{0, 1, 0}, b};
  const Real vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const Real v = d1 - d3 > 0 ? d1 / (d1 - d3) : Real(0);
    return {{1 - v, v, 0}, a + ab * v};
  }
  const Vec3<Real> cp = p - c;
  const Real d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {{0, 0, 1}, c};
  const Real vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const Real w = d2 - d6 > 0 ? d2 / (d2 - d6) : Real(0);
    return {{1 - w, 0, w}, a + ac * w};
  }
  const Real va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const Real length = (d4 - d3) + (d5 - d6);
    const Real w = length > 0 ? (d4 - d3) / length : Real(0);
    return {{0, 1 - w, w}, b + (c - b) * w};
  }
  const Real inverse = Real(1) / (va + vb + vc);
  const Real v = vb * inverse, w = vc * inverse;
  return {{1 - v - w, v, w}, a + ab * v + ac * w};
}

}  // namespace palpate
