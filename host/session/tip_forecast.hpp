// Where on the body the tip will be some ticks from now.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

class TipForecast {
 public:
  // The body must outlive it.
  explicit TipForecast(const Body& body) : body_(body) {}

  // The tip at an update, later than the one before. position_m: the body's nodes then (3 x nodes), which
  // must stay until the next call. below: the surface point that the tip touches, or is over.
  void note(std::uint32_t tick, const Eigen::Vector3d& tip_m, const Eigen::Matrix3Xd& position_m,
            const SurfacePoint& below);

  // Of another path.
  void forget() { noted_ = moves_ = false; }

  // Is its speed known?
  [[nodiscard]] bool moves() const { return moves_; }
  // The surface point nearest to where the tip will be, `ticks` after the newest update, by the mean velocity
  // since the update before; but never beneath the plane of the triangle that it is over or touches: it stays
  // on it, or goes along. Without a known speed: where it is. Empty where the tip then is more than within_m
  // from the surface.
  [[nodiscard]] std::optional<SurfacePoint> place(double ticks, double within_m) const;

 private:
  const Body& body_;
  std::uint32_t tick_ = 0;
  bool noted_ = false, moves_ = false;
  Eigen::Vector3d tip_m_ = Eigen::Vector3d::Zero(), velocity_m_tick_ = Eigen::Vector3d::Zero();
  const Eigen::Matrix3Xd* position_m_ = nullptr;
  SurfacePoint below_;
};

}  // namespace palpate::host
