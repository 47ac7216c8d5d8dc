#include "host/msd/step_input.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace palpate::host {

void require_step(double step_s) {
  if (!(step_s > 0) || !std::isfinite(step_s))
    throw std::invalid_argument("step_s is " + std::to_string(step_s) + ", allowed: positive and finite");
}

void add_external(std::span<const NodalForce> external, NodalArray& force_N) {
  for (const NodalForce& force : external) {
    if (force.node < 0 || force.node >= force_N.rows())
      throw std::invalid_argument("external force on node " + std::to_string(force.node) +
                                  ", allowed: 0 to " + std::to_string(force_N.rows() - 1));
    if (!is_finite(force.force_N))
      throw std::invalid_argument("external force on node " + std::to_string(force.node) + " is not finite");
    force_N.row(force.node) += to_eigen(force.force_N).transpose();
  }
}

NodalArray inverse_mass_1_kg(const Body& body) {
  NodalArray inverse = NodalArray::Zero(body.node_count(), 3);
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (!body.fixed(node)) inverse(node, axis) = 1.0 / body.mass_kg(node);
  return inverse;
}

}  // namespace palpate::host
