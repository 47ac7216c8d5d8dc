// A local model that lies in a struct as the runtime takes it. For the host and for tests.
#pragma once

#include <cstddef>

#include "shared/model/local_model.hpp"
#include "shared/wire/model_contents.hpp"

namespace palpate::wire {

// The constant part; valid as long as the contents. contents.surface must be a SurfaceKind.
inline LocalModelView view_of(const ModelContents& contents) {
  return {.modes = contents.modes,
          .nodes = contents.nodes,
          .surface_nodes = contents.surface_nodes,
          .triangles = contents.triangles,
          .surface = static_cast<SurfaceKind>(contents.surface),
          .origin_m = {contents.origin_m[0], contents.origin_m[1], contents.origin_m[2]},
          .position_m = contents.position_m.elements,
          .corner = contents.corner.elements,
          .triangle_id = contents.triangle_id.elements,
          .frictions = contents.static_friction.count,
          .static_friction = contents.static_friction.elements,
          .kinetic_friction = contents.kinetic_friction.elements,
          .triangle_friction = contents.triangle_friction.elements,
          .coefficient = contents.coefficient.elements,
          .load = contents.load.elements,
          .basis_scale = contents.basis_scale.elements,
          .basis = contents.basis.elements,
          .springs = contents.spring_kind.count,
          .rest_m = contents.rest_m.elements,
          .spring_end = contents.spring_end.elements,
          .spring_kind = contents.spring_kind.elements,
          .spring_kinds = contents.spring_stiffness_N_m.count,
          .spring_stiffness_N_m = contents.spring_stiffness_N_m.elements,
          .spring_damping_N_s_m = contents.spring_damping_N_s_m.elements,
          .spring_length_m = contents.spring_length_m.elements};
}

// The modal state in the contents, whose counts must be those of the modes.
inline void read_state(const ModelContents& contents, ModalState& state) {
  for (std::size_t m = 0; m < contents.modes; ++m) {
    state.q[m] = contents.state_q.elements[m];
    state.p[m] = contents.state_p.elements[m];
  }
}

}  // namespace palpate::wire
