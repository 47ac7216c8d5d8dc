// How a body is advanced in time.
#pragma once

#include <memory>
#include <span>

#include "host/msd/body.hpp"

namespace palpate::host {

// Advances a state by one step. Holds scratch memory: one object per thread. The body must outlive it.
class Integrator {
 public:
  Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;
  virtual ~Integrator() = default;

  // Advances `state` by step_s under springs, dampers, weight and `external` (constant over the step; several
  // forces on one node add up; forces on fixed nodes and, for planar bodies, along y are ignored). Throws
  // std::invalid_argument for a step that is not positive and finite or is unstable, and for a node that does
  // not exist; std::runtime_error where the step cannot be computed. The state is then unspecified.
  virtual void step(BodyState& state, std::span<const NodalForce> external, double step_s) = 0;
};

enum class Method {
  semi_implicit_euler,  // explicit, order 1, bounded step (semi_implicit_euler.hpp)
  implicit_euler,       // order 1, any step (implicit_integrator.hpp)
  sdirk2,               // order 2, any step (implicit_integrator.hpp)
};

std::unique_ptr<Integrator> make_integrator(Method method, const Body& body);

}  // namespace palpate::host
