// The local model within its message: its constant part, and the state that it starts from.
#pragma once

#include <cstddef>

#include "shared/model/local_model.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::wire {

// The constant part of the model that the message holds; valid as long as the message. message.surface must
// be a SurfaceKind. Any context.
inline LocalModelView view_of(const palpate_LocalModel_1_0& message) {
  return {.modes = message.modes,
          .nodes = message.nodes,
          .triangles = message.triangles,
          .surface = static_cast<SurfaceKind>(message.surface),
          .origin_m = {message.origin_m[0], message.origin_m[1], message.origin_m[2]},
          .position_m = message.position_m.elements,
          .corner = message.corner.elements,
          .triangle_id = message.triangle_id.elements,
          .frictions = message.static_friction.count,
          .static_friction = message.static_friction.elements,
          .kinetic_friction = message.kinetic_friction.elements,
          .triangle_friction = message.triangle_friction.elements,
          .coefficient = message.coefficient.elements,
          .load = message.load.elements,
          .basis_scale = message.basis_scale.elements,
          .basis = message.basis.elements};
}

// The modal state in the message, whose counts must have been checked. Any context.
inline void read_state(const palpate_LocalModel_1_0& message, ModalState& state) {
  for (std::size_t m = 0; m < message.modes; ++m) {
    state.q[m] = message.state_q.elements[m];
    state.p[m] = message.state_p.elements[m];
  }
}

}  // namespace palpate::wire
