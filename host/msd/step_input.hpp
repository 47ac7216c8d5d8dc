// What every integrator checks and prepares alike.
#pragma once

#include <span>

#include "host/msd/body.hpp"
#include "host/msd/vectors.hpp"

namespace palpate::host {

// Throws std::invalid_argument unless 0 < step_s < infinity.
void require_step(double step_s);

// Adds external forces to force_N (nodes x 3). Throws std::invalid_argument for a node that does not exist or
// a force that is not finite.
void add_external(std::span<const NodalForce> external, NodalArray& force_N);

// 1 / mass where a node can move along an axis, 0 where it cannot (nodes x 3).
NodalArray inverse_mass_1_kg(const Body& body);

}  // namespace palpate::host
