#include "host/plant/hand_guide.hpp"

#include <stdexcept>

#include "host/plant/check.hpp"

namespace palpate::plant {

HandGuide::HandGuide(const HandGuideParameters& parameters, const Vec3d& start_m) : parameters_(parameters) {
  require_range("hand guide bandwidth_rad_s", parameters.bandwidth_rad_s, 1.0, 100.0);
  require_range("hand guide greatest_speed_m_s", parameters.greatest_speed_m_s, 0.01, 2.5);
  jump_to(start_m);
}

void HandGuide::set_target(const Vec3d& target_m) {
  if (!is_finite(target_m)) throw std::invalid_argument("hand guide: the target is not finite");
  target_m_ = target_m;
}

void HandGuide::jump_to(const Vec3d& position_m) {
  set_target(position_m);
  now_ = {position_m, {}};
}

PathPoint HandGuide::advance(double duration_s) {
  require_range("hand guide duration_s", duration_s, 1e-6, 0.01);
  // Implicit Euler of x'' = w^2 (target - x) - 2 w x': stable for every w dt.
  const double w_dt = parameters_.bandwidth_rad_s * duration_s;
  const Vec3d pull_m_s = (target_m_ - now_.position_m) * (parameters_.bandwidth_rad_s * w_dt);
  Vec3d velocity_m_s = (now_.velocity_m_s + pull_m_s) * (1.0 / ((1.0 + w_dt) * (1.0 + w_dt)));
  const double speed_m_s = norm(velocity_m_s);
  if (speed_m_s > parameters_.greatest_speed_m_s) velocity_m_s *= parameters_.greatest_speed_m_s / speed_m_s;
  now_ = {now_.position_m + velocity_m_s * duration_s, velocity_m_s};
  return now_;
}

}  // namespace palpate::plant
