#include "host/msd/energy.hpp"

namespace palpate::host {

double potential_energy_J(const Body& body, const BodyState& state) {
  double energy_J = 0;
  for (const Spring& spring : body.springs()) {
    const double stretch_m =
        (state.position_m.col(spring.j) - state.position_m.col(spring.i)).norm() - spring.rest_length_m;
    energy_J += 0.5 * spring.stiffness_N_m * stretch_m * stretch_m;
  }
  const Eigen::Vector3d gravity_m_s2 = to_eigen(body.gravity_m_s2());
  for (int node = 0; node < body.node_count(); ++node)
    energy_J -= body.mass_kg(node) * gravity_m_s2.dot(state.position_m.col(node));
  return energy_J;
}

double kinetic_energy_J(const Body& body, const BodyState& state) {
  double energy_J = 0;
  for (int node = 0; node < body.node_count(); ++node)
    energy_J += 0.5 * body.mass_kg(node) * state.velocity_m_s.col(node).squaredNorm();
  return energy_J;
}

double dissipated_power_W(const Body& body, const BodyState& state) {
  double power_W = 0;
  for (const Spring& spring : body.springs()) {
    const SpringState now = evaluate(spring, state.position_m, state.velocity_m_s);
    const double rate_m_s = now.relative_velocity_m_s.dot(now.direction);
    power_W += spring.damping_N_s_m * rate_m_s * rate_m_s;
  }
  return power_W;
}

}  // namespace palpate::host
