// What connects the tip with the point of the surface that it touches: nothing that yields, or a spring with
// a damper.
//
//   f = K s + B s',   s = tip - contact point   (the stretch; f: force of the tip on the body)
//
// Stepped by backward Euler over a step h: s_k = c f_k + r s_(k-1) with c = 1 / (K + B/h), r = (B/h) c. To
// the contact problem it is the compliance c more and a target moved by r s_(k-1); it takes up energy in
// every step, for any h (shared/contact/coupling_test.cpp). Source: Colgate, Stanley, Brown, Issues in the
// haptic display of tool use, IROS 1995 (virtual coupling).
#pragma once

#include <cstdint>

#include "shared/math/linear.hpp"

namespace palpate {

// Stiffness 0 means kinematic: the contact point is where the tip is. Both >= 0; the damping counts only with
// a stiffness.
template <class Real>
struct Coupling {
  Real stiffness_N_m = 0;
  Real damping_N_s_m = 0;
};

// Where the device's tip is taken to be: values travel over the link (palpate.ModelState TIP_*).
enum class TipSource : std::uint8_t {
  counts = 0,    // where the encoder counts say
  estimated = 1  // estimated between them (shared/device/count_estimator.hpp)
};

// The coupling over one step.
template <class Real>
struct CouplingStep {
  Real compliance_m_N = 0;  // of the stretch at the end of the step to the force during it
  Real memory = 0;          // share of the stretch that a step without force leaves; in [0, 1)

  CouplingStep(const Coupling<Real>& coupling, Real step_s) {
    if (!(coupling.stiffness_N_m > 0)) return;
    const Real per_step = coupling.damping_N_s_m / step_s;
    compliance_m_N = Real(1) / (coupling.stiffness_N_m + per_step);
    memory = per_step * compliance_m_N;
  }
  [[nodiscard]] bool yields() const { return compliance_m_N > 0; }
  // Stretch at the end of the step.
  [[nodiscard]] Vec3<Real> stretch_m(const Vec3<Real>& before_m, const Vec3<Real>& force_N) const {
    return force_N * compliance_m_N + before_m * memory;
  }
};

}  // namespace palpate
