// The springs whose exact forces the board computes around the contact (shared/model/near_field.hpp).
#pragma once

#include "host/linearize/local_model.hpp"
#include "host/linearize/model_surface.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// Adds to a model with the tangent at rest the nodes below its surface, nearest to the middle of that first
// as far as the capacity goes, and the springs between its nodes that end on the surface. Nodes come from
// model.dof_node; fixed ones only where they are on the surface.
void add_near_field(LocalModel& model, const Body& body, const BodyState& state,
                    const LocalModelCapacity& capacity);

}  // namespace palpate::host
