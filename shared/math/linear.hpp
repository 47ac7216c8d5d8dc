// Vectors and 3x3 matrices with a fixed order of operations, so that every machine computes the same bits.
#pragma once

#include <cmath>
#include <cstddef>

namespace palpate {

// A vector in R^3; components in the unit and frame that the owner's name states.
template <class Real>
struct Vec3 {
  Real x{}, y{}, z{};

  constexpr Real& operator[](std::size_t i) { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr const Real& operator[](std::size_t i) const { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr Vec3& operator+=(const Vec3& b) { return *this = {x + b.x, y + b.y, z + b.z}; }
  constexpr Vec3& operator-=(const Vec3& b) { return *this = {x - b.x, y - b.y, z - b.z}; }
  constexpr Vec3& operator*=(Real s) { return *this = {x * s, y * s, z * s}; }
  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

template <class Real>
constexpr Vec3<Real> operator+(Vec3<Real> a, const Vec3<Real>& b) {
  return a += b;
}
template <class Real>
constexpr Vec3<Real> operator-(Vec3<Real> a, const Vec3<Real>& b) {
  return a -= b;
}
template <class Real>
constexpr Vec3<Real> operator-(const Vec3<Real>& a) {
  return {-a.x, -a.y, -a.z};
}
template <class Real>
constexpr Vec3<Real> operator*(Vec3<Real> a, Real s) {
  return a *= s;
}
template <class Real>
constexpr Vec3<Real> operator*(Real s, Vec3<Real> a) {
  return a *= s;
}

template <class Real>
constexpr Real dot(const Vec3<Real>& a, const Vec3<Real>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class Real>
constexpr Vec3<Real> cross(const Vec3<Real>& a, const Vec3<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// std::sqrt is correctly rounded on every target (IEEE 754), so norms are the same bits everywhere.
template <class Real>
inline Real norm(const Vec3<Real>& a) {
  return std::sqrt(dot(a, a));
}

// a / |a|; the zero vector where |a| is not above the smallest length that still has a direction.
template <class Real>
inline Vec3<Real> normalized(const Vec3<Real>& a) {
  constexpr Real kSmallestLength = Real(1e-18);
  const Real length = norm(a);
  return length > kSmallestLength ? a * (Real(1) / length) : Vec3<Real>{};
}

template <class Real>
inline bool is_finite(const Vec3<Real>& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

// A 3x3 matrix, row by row.
template <class Real>
struct Mat3 {
  Vec3<Real> row[3]{};

  static constexpr Mat3 identity(Real s = Real(1)) { return {{{s, 0, 0}, {0, s, 0}, {0, 0, s}}}; }
  constexpr Real& operator()(std::size_t r, std::size_t c) { return row[r][c]; }
  constexpr const Real& operator()(std::size_t r, std::size_t c) const { return row[r][c]; }
};

template <class Real>
constexpr Vec3<Real> operator*(const Mat3<Real>& a, const Vec3<Real>& b) {
  return {dot(a.row[0], b), dot(a.row[1], b), dot(a.row[2], b)};
}

template <class Real>
constexpr Mat3<Real> operator+(const Mat3<Real>& a, const Mat3<Real>& b) {
  return {{a.row[0] + b.row[0], a.row[1] + b.row[1], a.row[2] + b.row[2]}};
}

template <class Real>
constexpr Mat3<Real> transpose(const Mat3<Real>& a) {
  return {{{a(0, 0), a(1, 0), a(2, 0)}, {a(0, 1), a(1, 1), a(2, 1)}, {a(0, 2), a(1, 2), a(2, 2)}}};
}

template <class Real>
constexpr Real determinant(const Mat3<Real>& a) {
  return dot(a.row[0], cross(a.row[1], a.row[2]));
}

// Solves a x = b by Cramer's rule. Returns false, and leaves x alone, where |det a| <= smallest_determinant.
template <class Real>
[[nodiscard]] constexpr bool solve(const Mat3<Real>& a, const Vec3<Real>& b, Vec3<Real>& x,
                                   Real smallest_determinant = Real(0)) {
  const Vec3<Real> c12 = cross(a.row[1], a.row[2]);
  const Real det = dot(a.row[0], c12);
  const Real magnitude = det < Real(0) ? -det : det;
  if (!(magnitude > smallest_determinant)) return false;
  const Vec3<Real> c20 = cross(a.row[2], a.row[0]);
  const Vec3<Real> c01 = cross(a.row[0], a.row[1]);
  const Real inverse = Real(1) / det;
  x = (c12 * b.x + c20 * b.y + c01 * b.z) * inverse;
  return true;
}

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Mat3f = Mat3<float>;
using Mat3d = Mat3<double>;

}  // namespace palpate
