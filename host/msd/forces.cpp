#include "host/msd/forces.hpp"

namespace palpate::host {

ForceEvaluator::ForceEvaluator(const Body& body)
    : layout_(make_spring_layout(body)), weight_N_(body.node_count(), 3) {
  for (int node = 0; node < body.node_count(); ++node)
    weight_N_.row(node) = body.mass_kg(node) * to_eigen(body.gravity_m_s2()).transpose();
}

void ForceEvaluator::evaluate(const BodyState& state, Eigen::Matrix3Xd& force_N) {
  position_m_ = state.position_m.transpose();
  velocity_m_s_ = state.velocity_m_s.transpose();
  evaluate(position_m_, velocity_m_s_, force_N_);
  force_N = force_N_.transpose();
}

void ForceEvaluator::evaluate(const NodalArray& position_m, const NodalArray& velocity_m_s,
                              NodalArray& force_N) const {
  force_N = weight_N_;
  for (const SpringBand& band : layout_.bands)
    add_band_forces(band.view(), view(position_m), view(velocity_m_s), mutable_view(force_N));
  for (const Spring& spring : layout_.loose) {
    const Eigen::RowVector3d separation_m = position_m.row(spring.j) - position_m.row(spring.i);
    const double length_m = separation_m.norm();
    if (length_m <= kSmallestSpringLength_m) continue;
    const Eigen::RowVector3d direction = separation_m / length_m;
    const double closing_m_s = (velocity_m_s.row(spring.j) - velocity_m_s.row(spring.i)).dot(direction);
    const Eigen::RowVector3d pull_N =
        (spring.stiffness_N_m * (length_m - spring.rest_length_m) + spring.damping_N_s_m * closing_m_s) *
        direction;
    force_N.row(spring.i) += pull_N;
    force_N.row(spring.j) -= pull_N;
  }
}

Eigen::Vector3d nodal_force_N(const Body& body, const BodyState& state, int node) {
  Eigen::Vector3d force_N = body.mass_kg(node) * to_eigen(body.gravity_m_s2());
  for (const int s : body.springs_of(node)) {
    const Spring& spring = body.springs()[static_cast<std::size_t>(s)];
    const Eigen::Vector3d on_i_N = evaluate(spring, state.position_m, state.velocity_m_s).force_on_i_N();
    force_N += spring.i == node ? on_i_N : Eigen::Vector3d(-on_i_N);
  }
  return force_N;
}

}  // namespace palpate::host
