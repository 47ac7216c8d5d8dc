#include "host/msd/node_drives.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "shared/math/minimum_jerk.hpp"

namespace palpate::host {
namespace {

template <class Value>
[[noreturn]] void refuse(std::size_t index, const char* key, const Value& value, const std::string& allowed) {
  std::ostringstream message;
  message << "body.drives[" << index << "]." << key << " = " << value << ": must be " << allowed;
  throw std::invalid_argument(message.str());
}

std::string seconds(double time_s) {
  std::ostringstream text;
  text << time_s << " s";
  return text.str();
}

void validate(const Body& body, const std::vector<NodeDrive>& drives) {
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const NodeDrive& drive = drives[i];
    if (drive.node < 0 || drive.node >= body.node_count())
      refuse(i, "node", drive.node, "0 to " + std::to_string(body.node_count() - 1));
    if (body.fixed(drive.node)) refuse(i, "node", drive.node, "a node that is not fixed");
    if (!(drive.start_s >= 0) || !std::isfinite(drive.start_s))
      refuse(i, "start_s", drive.start_s, "0 s or later");
    if (!(drive.reach_s > drive.start_s) || !std::isfinite(drive.reach_s))
      refuse(i, "reach_s", drive.reach_s, "later than start_s = " + seconds(drive.start_s));
    if (!(drive.release_s >= drive.reach_s) || !std::isfinite(drive.release_s))
      refuse(i, "release_s", drive.release_s, "at or after reach_s = " + seconds(drive.reach_s));
    const std::pair<const char*, double> components[] = {{"displacement_m.x", drive.displacement_m.x},
                                                         {"displacement_m.y", drive.displacement_m.y},
                                                         {"displacement_m.z", drive.displacement_m.z}};
    for (const auto& [name, value] : components)
      if (!std::isfinite(value)) refuse(i, name, value, "finite");
    if (body.planar() && drive.displacement_m.y != 0)
      refuse(i, "displacement_m.y", drive.displacement_m.y, "0: the body is in the plane of x and z");
    for (std::size_t other = 0; other < i; ++other)
      if (drives[other].node == drive.node && drives[other].start_s < drive.release_s &&
          drive.start_s < drives[other].release_s)
        refuse(i, "node", drive.node,
               "a node that body.drives[" + std::to_string(other) + "] does not drive at the same time");
  }
}

}  // namespace

NodeDrives::NodeDrives(const Body& body, const std::vector<NodeDrive>& drives, double step_s)
    : step_s_(step_s) {
  validate(body, drives);
  for (const NodeDrive& drive : drives) {
    Scheduled scheduled{drive, std::llround(drive.start_s / step_s), std::llround(drive.release_s / step_s)};
    scheduled.to_m = Eigen::Vector3d(body.rest_position_m().col(drive.node)) + to_eigen(drive.displacement_m);
    drives_.push_back(scheduled);
  }
}

void NodeDrives::impose(BodyState& state) {
  for (Scheduled& scheduled : drives_) {
    if (steps_ < scheduled.first_step || steps_ >= scheduled.end_step) continue;
    const NodeDrive& drive = scheduled.drive;
    const Eigen::Vector3d here_m = state.position_m.col(drive.node);
    if (steps_ == scheduled.first_step) scheduled.from_m = here_m;
    const double end_s = static_cast<double>(steps_ + 1) * step_s_;
    const double u = std::clamp((end_s - drive.start_s) / (drive.reach_s - drive.start_s), 0.0, 1.0);
    const Eigen::Vector3d there_m = scheduled.from_m + (scheduled.to_m - scheduled.from_m) * minimum_jerk(u);
    state.velocity_m_s.col(drive.node) = (there_m - here_m) / step_s_;
  }
  ++steps_;
}

bool NodeDrives::drove(int node) const {
  return std::any_of(drives_.begin(), drives_.end(), [&](const Scheduled& scheduled) {
    return scheduled.drive.node == node && steps_ - 1 >= scheduled.first_step &&
           steps_ - 1 < scheduled.end_step;
  });
}

std::vector<int> NodeDrives::upcoming() const {
  std::vector<int> nodes;
  for (const Scheduled& scheduled : drives_)
    if (steps_ >= scheduled.first_step && steps_ < scheduled.end_step) nodes.push_back(scheduled.drive.node);
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

}  // namespace palpate::host
