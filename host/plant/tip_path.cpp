#include "host/plant/tip_path.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "shared/math/minimum_jerk.hpp"

namespace palpate::plant {

TipPath::TipPath(Kind kind, std::vector<TimedPosition> points) : kind_(kind), points_(std::move(points)) {
  if (points_.empty()) throw std::invalid_argument("tip path has 0 points, allowed: at least 1");
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const TimedPosition& point = points_[i];
    std::ostringstream message;
    message << "tip path point " << i << ": ";
    if (!std::isfinite(point.time_s)) {
      message << "time " << point.time_s << " s, allowed: finite";
      throw std::invalid_argument(message.str());
    }
    if (!is_finite(point.position_m)) {
      message << "position (" << point.position_m.x << ", " << point.position_m.y << ", "
              << point.position_m.z << ") m, allowed: finite";
      throw std::invalid_argument(message.str());
    }
    if (i > 0 && !(point.time_s > points_[i - 1].time_s)) {
      message << "time " << point.time_s << " s, allowed: later than the previous point's "
              << points_[i - 1].time_s << " s";
      throw std::invalid_argument(message.str());
    }
  }
}

TipPath TipPath::minimum_jerk(std::vector<TimedPosition> waypoints) {
  return {Kind::minimum_jerk, std::move(waypoints)};
}

TipPath TipPath::samples(std::vector<TimedPosition> points) {
  return {Kind::samples, std::move(points)};
}

PathPoint TipPath::at(double time_s) const {
  const auto after = std::upper_bound(points_.begin(), points_.end(), time_s,
                                      [](double t, const TimedPosition& point) { return t < point.time_s; });
  if (after == points_.begin()) return {points_.front().position_m, {}};
  if (after == points_.end()) return {points_.back().position_m, {}};
  const TimedPosition& from = *std::prev(after);
  const Vec3d way_m = after->position_m - from.position_m;
  const double duration_s = after->time_s - from.time_s;
  const double u = (time_s - from.time_s) / duration_s;
  if (kind_ == Kind::samples) return {from.position_m + way_m * u, way_m * (1.0 / duration_s)};
  const double progress = palpate::minimum_jerk(u);
  const double rate_1_s = 30.0 * u * u * (1.0 - u) * (1.0 - u) / duration_s;
  return {from.position_m + way_m * progress, way_m * rate_1_s};
}

}  // namespace palpate::plant
