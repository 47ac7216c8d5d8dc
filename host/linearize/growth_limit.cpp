#include "host/linearize/growth_limit.hpp"

#include <cmath>
#include <cstddef>

namespace palpate::host {

double least_lambda_rad2_s2(double damping_rad_s, double time_s) {
  const double growth_1_s = std::log(kLargestGrowth) / time_s;
  return -growth_1_s * (growth_1_s + damping_rad_s);
}

void limit_growth(LocalModel& model, double time_s) {
  model.limited_modes = 0;
  for (Eigen::Index m = 0; m < model.modes(); ++m) {
    const double least = least_lambda_rad2_s2(model.damping_rad_s[m], time_s);
    if (model.lambda_rad2_s2[m] >= least) continue;
    model.lambda_rad2_s2[m] = least;
    model.coefficient[static_cast<std::size_t>(m)] =
        modal_coefficients(least, model.damping_rad_s[m], model.step_s);
    ++model.limited_modes;
  }
}

}  // namespace palpate::host
