// A local model as it is before it is cut into basis and state for the wire: single precision, all of it in
// one place. For the host and for tests; a board has no room for it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/Contact_1_0.h"
#include "shared/model/local_model.hpp"

namespace palpate::wire {

template <class T, std::size_t Capacity>
struct BoundedArray {
  std::size_t count = 0;
  T elements[Capacity]{};
};

// Fields as in palpate.ModelState and in the basis (model_basis.hpp).
struct ModelContents {
  std::uint32_t sequence = 0;
  std::uint64_t schema_hash = 0;
  std::uint32_t tick = 0;
  std::uint16_t valid_ticks = 0;
  std::uint16_t growth_ticks = 0;
  std::uint16_t modes = 0;
  std::uint8_t nodes = 0;
  std::uint8_t surface_nodes = 0;
  std::uint8_t triangles = 0;
  float origin_m[3]{};
  float tip_radius_m = 0;
  std::uint8_t surface = 0;  // SurfaceKind
  std::uint8_t target_below_half_16ths = 0;
  float coupling_stiffness_N_m = 0;
  float coupling_damping_N_s_m = 0;
  std::uint8_t tip_source = 0;
  std::uint8_t kind = 0;  // ModelKind
  palpate_Contact_1_0 contact{};
  BoundedArray<float, 3 * kMaxSurfaceNodes> position_m;  // at q = 0
  BoundedArray<std::uint16_t, kMaxTriangles> triangle_id;
  BoundedArray<std::uint8_t, 3 * kMaxTriangles> corner;
  BoundedArray<std::uint8_t, kMaxTriangles> triangle_friction;
  BoundedArray<float, kMaxFrictions> static_friction, kinetic_friction;
  BoundedArray<float, kCoefficientsPerMode * kMaxModes> coefficient;
  BoundedArray<float, kMaxModes> load, state_q, state_p, basis_scale;
  BoundedArray<std::int16_t, kMaxBasis> basis;
  // The nodes' rest positions, which do not change from state to state; empty: those of position_m are taken
  // for the basis' own.
  BoundedArray<float, 3 * kMaxSurfaceNodes> rest_m;
  BoundedArray<std::uint8_t, 2 * kMaxSprings> spring_end;
  BoundedArray<std::uint8_t, kMaxSprings> spring_kind;
  BoundedArray<float, kMaxSpringKinds> spring_stiffness_N_m, spring_damping_N_s_m, spring_length_m;
};

}  // namespace palpate::wire
