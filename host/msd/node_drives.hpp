// Nodes that are moved along a given path, whatever the forces: an instrument that pulls a single node
// (Jacobs, Fu, Cavusoglu 2010, section 5.1).
#pragma once

#include <cstdint>
#include <vector>

#include "host/msd/body.hpp"

namespace palpate::host {

// Times count from the body's start and are rounded to whole steps. From start_s on the node moves from where
// it is then to its place of rest + displacement_m, with least jerk (10 u^3 - 15 u^4 + 6 u^5), arrives at
// reach_s, stays there at rest, and is free again from release_s on.
struct NodeDrive {
  int node = 0;
  double start_s = 0;
  double reach_s = 0;
  double release_s = 0;
  Vec3d displacement_m{};
};

// The drives of one body over time. Called once per step of the semi-implicit integrator, between its predict
// and its finish.
class NodeDrives {
 public:
  // No drives: impose() only counts.
  NodeDrives() = default;
  // Throws std::invalid_argument, naming drive, key and value, for a node that does not exist or is fixed,
  // for times that are not finite or do not fulfil 0 <= start < reach <= release, for displacements that are
  // not finite or leave the plane of a planar body, and for a node that is driven twice at a time.
  NodeDrives(const Body& body, const std::vector<NodeDrive>& drives, double step_s);

  // Gives every node that is driven in this step the velocity that takes it to its prescribed place within
  // the step. The force of the drive is m (this velocity - the one before) / step.
  void impose(BodyState& state);

  // Was the node driven in the newest step?
  [[nodiscard]] bool drove(int node) const;
  // Nodes that will be driven in the step to come, ascending.
  [[nodiscard]] std::vector<int> upcoming() const;

 private:
  struct Scheduled {
    NodeDrive drive;
    std::int64_t first_step = 0, end_step = 0;  // driven in the steps first_step <= n < end_step
    Eigen::Vector3d from_m = Eigen::Vector3d::Zero(), to_m = Eigen::Vector3d::Zero();
  };

  std::vector<Scheduled> drives_;
  double step_s_ = 0;
  std::int64_t steps_ = 0;  // imposed so far
};

}  // namespace palpate::host
