#include "host/msd/stable_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::host {
namespace {

double largest_row_sum(const Eigen::Matrix3d& a) {
  return a.cwiseAbs().rowwise().sum().maxCoeff();
}

}  // namespace

double stable_step_s(const Body& body, const Eigen::Matrix3Xd& position_m) {
  const Eigen::Matrix3Xd at_rest = Eigen::Matrix3Xd::Zero(3, body.node_count());
  double step_s = std::numeric_limits<double>::infinity();
  for (int node = 0; node < body.node_count(); ++node) {
    if (body.fixed(node)) continue;
    Eigen::Matrix3d stiffness_N_m = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d damping_N_s_m = Eigen::Matrix3d::Zero();
    for (const int s : body.springs_of(node)) {
      const Spring& spring = body.springs()[static_cast<std::size_t>(s)];
      const SpringState now = evaluate(spring, position_m, at_rest);
      if (now.length_m <= kSmallestSpringLength_m) continue;
      const double weight = body.fixed(spring.i == node ? spring.j : spring.i) ? 1.0 : 2.0;
      const Eigen::Matrix3d along = now.direction * now.direction.transpose();
      const double geometric_N_m = std::max(0.0, now.tension_N / now.length_m);
      stiffness_N_m +=
          weight * (spring.stiffness_N_m * along + geometric_N_m * (Eigen::Matrix3d::Identity() - along));
      damping_N_s_m += weight * spring.damping_N_s_m * along;
    }
    const double k = largest_row_sum(stiffness_N_m) / body.mass_kg(node);
    const double d = largest_row_sum(damping_N_s_m) / body.mass_kg(node);
    if (k > 0) step_s = std::min(step_s, 4.0 / (d + std::sqrt(d * d + 4.0 * k)));
  }
  return step_s;
}

}  // namespace palpate::host
