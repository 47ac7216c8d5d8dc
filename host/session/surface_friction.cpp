#include "host/session/surface_friction.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "shared/model/local_model.hpp"

namespace palpate::host {
namespace {

void require_valid(const Friction<double>& friction, const std::string& where) {
  const double most = friction.static_coefficient;
  if (std::isfinite(most) && most >= 0.0 && friction.kinetic_coefficient >= 0.0 &&
      friction.kinetic_coefficient <= most)
    return;
  std::ostringstream message;
  message << where << ": static friction " << most << " and kinetic friction " << friction.kinetic_coefficient
          << ": must be finite, at least 0, the kinetic one at most the static one";
  throw std::invalid_argument(message.str());
}

void require_valid(const FrictionRegion& region, const std::string& where) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (region.from_m[axis] <= region.to_m[axis]) continue;
    std::ostringstream message;
    message << where << ": from_m[" << axis << "] = " << region.from_m[axis] << ": must be at most to_m["
            << axis << "] = " << region.to_m[axis];
    throw std::invalid_argument(message.str());
  }
  require_valid(region.friction, where);
}

bool holds(const FrictionRegion& region, const Eigen::Vector3d& point_m) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    if (point_m[axis] < region.from_m[a] || point_m[axis] > region.to_m[a]) return false;
  }
  return true;
}

}  // namespace

SurfaceFriction::SurfaceFriction(const Body& body, const FrictionSpec& spec) {
  const auto index_of = [&](const Friction<double>& friction) {
    const auto found = std::find(different_.begin(), different_.end(), friction);
    const auto index = static_cast<std::size_t>(found - different_.begin());
    if (found == different_.end()) different_.push_back(friction);
    if (different_.size() > kMaxFrictions)
      throw std::invalid_argument("contact.regions: more than " + std::to_string(kMaxFrictions) +
                                  " different frictions in one body: must be at most " +
                                  std::to_string(kMaxFrictions));
    return static_cast<std::uint8_t>(index);
  };
  require_valid(spec.elsewhere, "contact");
  const std::uint8_t elsewhere = index_of(spec.elsewhere);
  std::vector<std::uint8_t> index_of_region;
  for (std::size_t r = 0; r < spec.regions.size(); ++r) {
    require_valid(spec.regions[r], "contact.regions[" + std::to_string(r) + "]");
    index_of_region.push_back(index_of(spec.regions[r].friction));
  }

  for (const Triangle& corner : body.triangles()) {
    const auto& rest_m = body.rest_position_m();
    const Eigen::Vector3d centroid_m =
        (rest_m.col(corner[0]) + rest_m.col(corner[1]) + rest_m.col(corner[2])) / 3.0;
    std::uint8_t index = elsewhere;
    for (std::size_t r = 0; r < spec.regions.size(); ++r)
      if (holds(spec.regions[r], centroid_m)) index = index_of_region[r];
    index_.push_back(index);
  }
}

}  // namespace palpate::host
