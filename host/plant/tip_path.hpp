// Where the hand intends the tip to be, over time.
#pragma once

#include <vector>

#include "shared/math/linear.hpp"

namespace palpate::plant {

struct TimedPosition {
  double time_s;
  Vec3d position_m;  // device frame
};

struct PathPoint {
  Vec3d position_m{};  // device frame
  Vec3d velocity_m_s{};
};

class TipPath {
 public:
  // Straight minimum-jerk movements between waypoints, at rest in each of them: position a + (b - a) s(u)
  // with s of shared/math/minimum_jerk.hpp, u the fraction of the time between the two. A
  // pause is two waypoints in one place. Both factories throw std::invalid_argument for no point, a number
  // that is not finite, or times that do not strictly increase; the message names the point (counted from 0),
  // the value and what is allowed.
  static TipPath minimum_jerk(std::vector<TimedPosition> waypoints);
  // Straight lines between samples, for recorded paths: the velocity jumps at the samples, where the later
  // one counts.
  static TipPath samples(std::vector<TimedPosition> points);

  // Before the first point and after the last: there, at rest.
  [[nodiscard]] PathPoint at(double time_s) const;
  [[nodiscard]] double first_time_s() const { return points_.front().time_s; }
  [[nodiscard]] double last_time_s() const { return points_.back().time_s; }

 private:
  enum class Kind { minimum_jerk, samples };
  TipPath(Kind kind, std::vector<TimedPosition> points);

  Kind kind_;
  std::vector<TimedPosition> points_;
};

}  // namespace palpate::plant
