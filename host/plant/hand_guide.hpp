// Smooths what a mouse says into what a hand could intend: a critically damped follower with a limited speed.
#pragma once

#include "host/plant/tip_path.hpp"
#include "shared/math/linear.hpp"

namespace palpate::plant {

struct HandGuideParameters {
  double bandwidth_rad_s = 40.0;  // 90 % of a step after 0.1 s: a mouse is read some 30 times a second
  double greatest_speed_m_s = 0.5;
};

// One thread. Device frame.
class HandGuide {
 public:
  // At rest in `start_m`. Throws std::invalid_argument for parameters out of range.
  HandGuide(const HandGuideParameters& parameters, const Vec3d& start_m);

  // Throws std::invalid_argument when not finite.
  void set_target(const Vec3d& target_m);
  // At once, at rest.
  void jump_to(const Vec3d& position_m);
  // Lets duration_s in (0, 0.01] pass and returns where the hand intends to be then.
  PathPoint advance(double duration_s);
  [[nodiscard]] const PathPoint& now() const { return now_; }

 private:
  HandGuideParameters parameters_;
  Vec3d target_m_;
  PathPoint now_;
};

}  // namespace palpate::plant
