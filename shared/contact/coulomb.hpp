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
// 1991).
inline constexpr int kSlipIterations = 8;

// The contact point would be `gap_m` short of its target at the end of the step if no force acted, and a
// force f moves it by compliance * f. normal: unit, outward. previous: mode of the step before.
//   stick:  compliance f = gap
//   slip:   n . (compliance f) = n . gap,  |f_t| = mu_k f_n,  f_t along the tip's motion over the surface,
//   that is
//           along the tangential part of gap - compliance f (clipping the sticking force alone would change
//           the normal displacement through the off-diagonal compliance)
//   free:   the normal force of the solution would pull
// A contact that is sticking breaks loose above the static coefficient; one that is slipping sticks again
// below the kinetic one. Where C_nn - mu C_nt.d <= 0 slip has no solution that presses (the contact is
// wedged): it sticks. Source: Jacobs, Fu, Cavusoglu 2010, section 4.2.3 and equations (24)-(31); the slip
// condition is ours.
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
  const Real kinetic = friction.kinetic_coefficient;
  Vec3<Real> direction = normalized(stick_t);
  Vec3<Real> force{};
  for (int i = 0; i < kSlipIterations; ++i) {
    const Real denominator = cnn - kinetic * dot(cn, direction);
    if (!(denominator > 0))
      return stick_n > 0 ? ContactForce<Real>{ContactMode::stick, stick} : ContactForce<Real>{};
    force = (direction * kinetic - normal) * (-gap_n / denominator);
    if (!(kinetic > 0)) break;
    const Vec3<Real> slip = gap_m - compliance_m_N * force;
    const Vec3<Real> slip_t = slip - normal * dot(normal, slip);
    const Vec3<Real> force_t = direction * (kinetic * gap_n / -denominator);
    const Vec3<Real> next = normalized(force_t + slip_t * stiffness_t);
    if (next == Vec3<Real>{}) break;
    direction = next;
  }
  return {ContactMode::slip, force};
}

}  // namespace palpate
