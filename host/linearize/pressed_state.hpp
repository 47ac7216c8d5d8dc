// A body with one node pressed in: the state at which local models are compared away from rest.
#pragma once

#include "host/msd/body.hpp"

namespace palpate::host {

// The node held at `displacement_m` from its place of rest until the body has settled: after 1 s, stepped by
// step_s, all velocities are set to zero. Device frame. Throws std::invalid_argument for a fixed node or a
// step that is not stable.
BodyState pressed_state(const Body& body, int node, const Eigen::Vector3d& displacement_m, double step_s);

}  // namespace palpate::host
