// A spring with an axial damper between two point masses: the force law of the body.
#pragma once

#include <Eigen/Core>

namespace palpate::host {

// Constant description. Nodes are indices into the body's nodes.
struct Spring {
  int i = 0;
  int j = 0;
  double stiffness_N_m = 0;
  double damping_N_s_m = 0;
  double rest_length_m = 0;
};

// Nodes closer than this have no direction between them: their spring then pulls with no force and has no
// tangent. Far below any length of a body and far above what underflows when squared.
inline constexpr double kSmallestSpringLength_m = 1e-30;

// A spring at given end points; the device frame.
struct SpringState {
  double length_m = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // unit, from i to j; zero for coincident nodes
  Eigen::Vector3d relative_velocity_m_s = Eigen::Vector3d::Zero();  // of j seen from i
  double tension_N = 0;  // k (length - rest length) + b d(length)/dt; positive pulls the nodes together

  [[nodiscard]] Eigen::Vector3d force_on_i_N() const { return tension_N * direction; }
};

// Evaluates a spring; columns of position_m and velocity_m_s are nodes.
inline SpringState evaluate(const Spring& spring, const Eigen::Matrix3Xd& position_m,
                            const Eigen::Matrix3Xd& velocity_m_s) {
  SpringState state;
  const Eigen::Vector3d separation_m = position_m.col(spring.j) - position_m.col(spring.i);
  state.relative_velocity_m_s = velocity_m_s.col(spring.j) - velocity_m_s.col(spring.i);
  state.length_m = separation_m.norm();
  if (state.length_m <= kSmallestSpringLength_m) return state;
  state.direction = separation_m / state.length_m;
  state.tension_N = spring.stiffness_N_m * (state.length_m - spring.rest_length_m) +
                    spring.damping_N_s_m * state.relative_velocity_m_s.dot(state.direction);
  return state;
}

}  // namespace palpate::host
