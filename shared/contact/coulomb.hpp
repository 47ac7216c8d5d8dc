// The force of one frictional contact point on a linear response, by Coulomb's law.
#pragma once

#include "shared/contact/contact_state.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

template <class Real>
struct ContactForce {
  ContactMode mode = ContactMode::free;
  Vec3<Real> force_N{};  // of the tip on the body
};

// The direction of slip is found by fixed-point iteration: friction + slip * (tangential stiffness) is
// projected back onto the circle of radius mu f_n (the augmented-Lagrangian iteration of Alart and Curnier,
// 1991). Where compliances of very different size are coupled it need not converge; then the solution is
// bracketed (slip_along_friction).
inline constexpr int kSlipIterations = 8;
// Cosine of the angle between friction and slip from which the iteration counts as converged: 2.6 degrees.
inline constexpr double kSlipConverged = 0.999;
inline constexpr int kSlipDoublings = 20;
inline constexpr int kSlipHalvings = 24;  // the digits of single precision

namespace contact_detail {

// A slip that goes along its friction, slip_t = lambda f_t with lambda >= 0, is a stick against a surface
// that yields by lambda more along the plane: f(lambda) = (C + lambda (I - n n'))^-1 gap. |f_t| - mu f_n is
// above 0 at lambda = 0, for sticking breaks the cone, and below for a large lambda, where f_t vanishes and
// f_n = -gap_n / C_nn > 0: with gap_n < 0 there is always a solution between, and halving finds it.
template <class Real>
Vec3<Real> slip_along_friction(const Vec3<Real>& gap_m, const Mat3<Real>& compliance_m_N,
                               const Vec3<Real>& normal, Real mu) {
  Vec3<Real> force{};
  const auto breaks_the_cone = [&](Real lambda_m_N) {
    Mat3<Real> yielding = compliance_m_N;
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c)
        yielding(r, c) += lambda_m_N * ((r == c ? Real(1) : Real(0)) - normal[r] * normal[c]);
    if (!solve(yielding, gap_m, force)) return true;
    const Real pressing = -dot(normal, force);
    return norm(force + normal * pressing) > mu * pressing;
  };
  Real low = 0, high = compliance_m_N(0, 0) + compliance_m_N(1, 1) + compliance_m_N(2, 2);
  for (int i = 0; i < kSlipDoublings && breaks_the_cone(high); ++i) {
    low = high;
    high *= Real(2);
  }
  for (int i = 0; i < kSlipHalvings; ++i) {
    const Real middle = (low + high) * Real(0.5);
    (breaks_the_cone(middle) ? low : high) = middle;
  }
  (void)breaks_the_cone(high);
  // Exactly on the cone and on the normal gap; the direction is that of the bracketed force.
  const Vec3<Real> direction = normalized(force + normal * -dot(normal, force));
  const Vec3<Real> on_cone = direction * mu - normal;
  return on_cone * (dot(normal, gap_m) / dot(normal, compliance_m_N * on_cone));
}

}  // namespace contact_detail

// The contact point would be `gap_m` short of its target at the end of the step if no force acted, and a
// force f moves it by compliance * f. normal: unit, outward. previous: mode of the step before.
//   stick:  compliance f = gap
//   slip:   n . (compliance f) = n . gap,  |f_t| = mu_k f_n,  f_t along the tip's motion over the surface,
//   that is
//           along the tangential part of gap - compliance f (clipping the sticking force alone would change
//           the normal displacement through the off-diagonal compliance)
//   free:   the normal force of the solution would pull
// A contact that is sticking breaks loose above the static coefficient; one that is slipping sticks again
// below the kinetic one. Where both no contact and a wedged one (C_nn - mu C_nt.d <= 0: friction would press
// the surface up faster than it yields) are solutions, there is none. Source: Jacobs, Fu, Cavusoglu 2010,
// section 4.2.3 and equations (24)-(31); the slip condition is ours.
template <class Real>
ContactForce<Real> solve_coulomb(const Vec3<Real>& gap_m, const Mat3<Real>& compliance_m_N,
                                 const Vec3<Real>& normal, const Friction<Real>& friction,
                                 ContactMode previous) {
  const Vec3<Real> cn = compliance_m_N * normal;  // symmetric: also n' C
  const Real cnn = dot(normal, cn);
  const Real gap_n = dot(normal, gap_m);

  Vec3<Real> stick{};
  if (!(cnn > 0) || !solve(compliance_m_N, gap_m, stick)) return {};
  const Real stick_n = -dot(normal, stick);  // pressing is positive
  const Vec3<Real> stick_t = stick + normal * stick_n;
  const Real stick_t_norm = norm(stick_t);
  const Real mu = previous == ContactMode::slip ? friction.kinetic_coefficient : friction.static_coefficient;
  if (stick_n > 0 && stick_t_norm <= mu * stick_n) return {ContactMode::stick, stick};
  if (!(gap_n < 0)) return {};  // the surface stays short of the tip by itself

  const Real stiffness_t =
      Real(2) / (compliance_m_N(0, 0) + compliance_m_N(1, 1) + compliance_m_N(2, 2) - cnn);
  Vec3<Real> direction = normalized(stick_t);
  Vec3<Real> force{}, slip_t{}, along{};
  bool presses = true;
  for (int i = 0; i < kSlipIterations; ++i) {
    const Real denominator = cnn - friction.kinetic_coefficient * dot(cn, direction);
    presses = denominator > 0;
    if (!presses) break;
    force = (direction * friction.kinetic_coefficient - normal) * (-gap_n / denominator);
    if (!(friction.kinetic_coefficient > 0)) return {ContactMode::slip, force};
    along = direction;
    const Vec3<Real> slip = gap_m - compliance_m_N * force;
    slip_t = slip - normal * dot(normal, slip);
    const Vec3<Real> sliding = direction * (friction.kinetic_coefficient * gap_n / -denominator);
    const Vec3<Real> next = normalized(sliding + slip_t * stiffness_t);
    if (next == Vec3<Real>{}) break;
    direction = next;
  }
  // A slip of the size of rounding has no direction.
  constexpr Real kRounding = static_cast<Real>(1e-5);
  const Real slip_norm = norm(slip_t);
  const bool converged = presses && (slip_norm <= kRounding * norm(gap_m) ||
                                     dot(slip_t, along) >= static_cast<Real>(kSlipConverged) * slip_norm);
  if (!converged)
    force = contact_detail::slip_along_friction(gap_m, compliance_m_N, normal, friction.kinetic_coefficient);
  return {ContactMode::slip, force};
}

}  // namespace palpate
