#include "host/plant/hand.hpp"

#include "host/plant/check.hpp"

namespace palpate::plant {

// Within these bounds the fastest rate, (damping + grip damping) / mass = 16,000 /s, is well inside the
// stability of Runge-Kutta steps of 50 us (2.78 / 50 us = 55,000 /s).
Hand::Hand(const HandParameters& parameters) : parameters_(parameters) {
  require_range("hand mass_kg", parameters.mass_kg, 0.01, 10.0);
  require_range("hand damping_N_s_m", parameters.damping_N_s_m, 0.0, 100.0);
  require_range("hand stiffness_N_m", parameters.stiffness_N_m, 0.0, 2e4);
  require_range("hand grip_stiffness_N_m", parameters.grip_stiffness_N_m, 0.0, 2e4);
  require_range("hand grip_damping_N_s_m", parameters.grip_damping_N_s_m, 0.0, 60.0);
}

Vec3d Hand::force_N(const HandState& hand, const Vec3d& tip_m, const Vec3d& tip_m_s, double grip) const {
  return ((hand.position_m - tip_m) * parameters_.grip_stiffness_N_m +
          (hand.velocity_m_s - tip_m_s) * parameters_.grip_damping_N_s_m) *
         grip;
}

Vec3d Hand::acceleration_m_s2(const HandState& hand, const PathPoint& intended,
                              const Vec3d& force_on_tool_N) const {
  const Vec3d force_N = (intended.position_m - hand.position_m) * parameters_.stiffness_N_m +
                        (intended.velocity_m_s - hand.velocity_m_s) * parameters_.damping_N_s_m -
                        force_on_tool_N;
  return force_N * (1.0 / parameters_.mass_kg);
}

}  // namespace palpate::plant
