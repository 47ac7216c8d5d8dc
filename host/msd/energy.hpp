// Energies of a body.
#pragma once

#include "host/msd/body.hpp"

namespace palpate::host {

// Springs, and weight relative to the origin of the device frame; fixed nodes included.
double potential_energy_J(const Body& body, const BodyState& state);
double kinetic_energy_J(const Body& body, const BodyState& state);
// What all dampers turn into heat per second; never negative.
double dissipated_power_W(const Body& body, const BodyState& state);

}  // namespace palpate::host
