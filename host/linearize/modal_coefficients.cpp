#include "host/linearize/modal_coefficients.hpp"

#include <Eigen/Core>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace palpate::host {
namespace {

[[noreturn]] void refuse(const char* name, double value, const char* allowed) {
  std::ostringstream message;
  message << name << " is " << value << ", allowed: " << allowed;
  throw std::invalid_argument(message.str());
}

// exp(g) - I by a Taylor polynomial of a halved argument and E(2t) = 2 E(t) + E(t)^2, which never subtracts
// the identity: entries far below 1 keep their relative accuracy.
Eigen::Matrix3d exponential_minus_identity(Eigen::Matrix3d g) {
  constexpr double kTaylorNorm = 0.25;  // 0.25^12 / 13! is below rounding
  constexpr int kTaylorOrder = 12;
  const double norm = g.cwiseAbs().rowwise().sum().maxCoeff();
  const int halvings = norm > kTaylorNorm ? std::ilogb(norm / kTaylorNorm) + 1 : 0;
  g *= std::ldexp(1.0, -halvings);
  Eigen::Matrix3d result = g / kTaylorOrder;  // Horner: g (I + g/2 (I + g/3 (...)))
  for (int k = kTaylorOrder - 1; k >= 1; --k) result = ((g + g * result) / k).eval();
  for (int i = 0; i < halvings; ++i) result = (2.0 * result + result * result).eval();
  return result;
}

}  // namespace

ModalCoefficients modal_coefficients(double lambda_rad2_s2, double damping_rad_s, double step_s) {
  if (!(step_s > 0) || !std::isfinite(step_s)) refuse("step_s", step_s, "positive and finite");

  // Time in steps: position q, velocity h p, force h^2 u.
  const double stiffness = lambda_rad2_s2 * step_s * step_s;
  const double damping = damping_rad_s * step_s;
  if (!std::isfinite(stiffness)) refuse("lambda_rad2_s2", lambda_rad2_s2, "finite times the squared step");
  if (!std::isfinite(damping)) refuse("damping_rad_s", damping_rad_s, "finite times the step");
  const double phase_squared = stiffness - 0.25 * damping * damping;
  if (phase_squared > kLargestResolvedPhase_rad * kLargestResolvedPhase_rad) {
    const double inverse = 1.0 / (1.0 + damping + stiffness);
    return {-stiffness * inverse,          step_s * inverse,
            -stiffness * inverse / step_s, -(damping + stiffness) * inverse,
            step_s * step_s * inverse,     step_s * inverse};
  }
  Eigen::Matrix3d generator;
  generator << 0, 1, 0, -stiffness, -damping, 1, 0, 0, 0;
  const Eigen::Matrix3d e = exponential_minus_identity(generator);
  if (!e.allFinite())
    refuse("lambda_rad2_s2", lambda_rad2_s2, "large enough for the mode to stay finite over a step");
  return {e(0, 0), step_s * e(0, 1), e(1, 0) / step_s, e(1, 1), step_s * step_s * e(0, 2), step_s * e(1, 2)};
}

}  // namespace palpate::host
