#include "host/session/tip_forecast.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace palpate::host {

void TipForecast::note(std::uint32_t tick, const Eigen::Vector3d& tip_m, const Eigen::Matrix3Xd& position_m,
                       const SurfacePoint& below) {
  moves_ = noted_ && tick != tick_;
  if (moves_) velocity_m_tick_ = (tip_m - tip_m_) / static_cast<double>(tick - tick_);
  noted_ = true;
  tick_ = tick;
  tip_m_ = tip_m;
  position_m_ = &position_m;
  below_ = below;
}

std::optional<SurfacePoint> TipForecast::place(double ticks, double within_m) const {
  if (!noted_) return std::nullopt;
  const Eigen::Matrix3Xd& position_m = *position_m_;
  Eigen::Vector3d then_m = tip_m_;
  if (moves_) then_m += ticks * velocity_m_tick_;
  const Triangle& corner = body_.triangles()[static_cast<std::size_t>(below_.triangle)];
  const Eigen::Vector3d normal = (position_m.col(corner[1]) - position_m.col(corner[0]))
                                     .cross(position_m.col(corner[2]) - position_m.col(corner[0]))
                                     .normalized();
  const Eigen::Vector3d below_m = surface_position_m(body_, position_m, below_);
  then_m -= std::min(0.0, (then_m - below_m).dot(normal)) * normal;
  SurfacePoint nearest = nearest_surface_point(body_, position_m, then_m);
  if ((surface_position_m(body_, position_m, nearest) - then_m).norm() > within_m) return std::nullopt;
  return nearest;
}

}  // namespace palpate::host
