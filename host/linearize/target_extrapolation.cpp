#include "host/linearize/target_extrapolation.hpp"

#include <algorithm>
#include <cmath>

#include "shared/model/local_model.hpp"

namespace palpate::host {

double centred_target_ticks(const LocalModel& model) {
  const double h = model.step_s;
  double output = 0.0, c0 = 0.0, c1_s = 0.0;
  for (Eigen::Index m = 0; m < model.modes(); ++m) {
    const double lambda = model.lambda_rad2_s2(m), damping = model.damping_rad_s(m);
    if (!(lambda > 0.0)) return 0.5;
    const double w = model.basis.col(m).head(3 * model.surface_nodes).squaredNorm();
    const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
    const double determinant = c.a11 * c.a22 - c.a12 * c.a21;
    const double right_q = 1.0 / lambda - c.b1, right_p = -c.b2;
    const double q = (c.a22 * right_q - c.a12 * right_p) / determinant;
    const double p = (c.a11 * right_p - c.a21 * right_q) / determinant;
    output += w * (q + 0.5 * h * p);
    c0 += w / lambda;
    c1_s += w * damping / (lambda * lambda);
  }
  return c0 > 0.0 ? (output + c1_s / h) / c0 - 0.5 : 0.5;
}

std::uint8_t target_below_half_16ths(const LocalModel& model) {
  constexpr double kMost = kMaxTargetBelowHalf_16ths;
  return static_cast<std::uint8_t>(
      std::clamp(std::round(16.0 * (0.5 - centred_target_ticks(model))), 0.0, kMost));
}

}  // namespace palpate::host
