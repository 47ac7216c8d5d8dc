// The local model that the microcontroller renders: independent second-order modes, stepped exactly at the
// servo rate, and a map from modes to the surface nodes around the tip (design: docs/architecture.md, "Local
// model").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/contact/surface_kind.hpp"
#include "shared/math/linear.hpp"
#include "shared/status.hpp"

namespace palpate {

// Fixed capacities; bases and states on the wire are bounded by them (shared/wire).
inline constexpr std::size_t kMostModes = 192;  // of any board: 64 nodes in 3D, the paper's 4x4x4 patch
// A build for a part with less memory sets fewer (docs/decisions/memory.md).
#ifndef PALPATE_MAX_MODES
#define PALPATE_MAX_MODES 192
#endif
inline constexpr std::size_t kMaxModes = PALPATE_MAX_MODES;
static_assert(kMaxModes <= kMostModes);
inline constexpr std::size_t kMaxSurfaceNodes = 32;
inline constexpr std::size_t kMaxTriangles = 96;
inline constexpr std::size_t kMaxFrictions = 4;  // different pairs of coefficients in one body
inline constexpr std::size_t kMaxSprings =
    192;  // of the near field: all in a patch of 4 x 4 x 2 nodes are 184
inline constexpr std::size_t kMaxSpringKinds = 16;
inline constexpr std::size_t kMaxNearModes = 128;  // of a model with springs
inline constexpr std::size_t kMaxBasis = 9216;     // rows x modes: 16 nodes x 3 x 192 modes, or 32 x 3 x 96
inline constexpr std::size_t kCoefficientsPerMode = 6;  // a11 a12 a21 a22 b1 b2

// What a local model is to the board. Values travel over the link (palpate.ModelState KIND_*): never renumber
// them.
enum class ModelKind : std::uint8_t {
  modes = 0,           // rolled forward from its own tick to now before it is rendered
  held_force = 1,      // no modes: one force until the next model
  modes_from_now = 2,  // its state, of an earlier tick, is taken for the present one
};

// The constant part of a local model, wherever it is stored. Positions in the device frame minus origin_m.
inline constexpr std::uint8_t kMaxTargetBelowHalf_16ths = 8;

struct LocalModelView {
  std::size_t modes = 0;
  std::size_t nodes = 0;          // those of the surface first, then those below it
  std::size_t surface_nodes = 0;  // at most `nodes`
  std::size_t triangles = 0;
  SurfaceKind surface = SurfaceKind::smooth;
  std::uint8_t target_below_half_16ths = 0;  // at most kMaxTargetBelowHalf_16ths
  Vec3f origin_m{};
  const float* position_m = nullptr;     // nodes x 3, at q = 0
  const std::uint8_t* corner = nullptr;  // triangles x 3, node indices, counter-clockwise seen from outside
  const std::uint16_t* triangle_id = nullptr;  // triangles; the body's own numbers
  std::size_t frictions = 0;
  const float* static_friction = nullptr;           // frictions
  const float* kinetic_friction = nullptr;          // frictions; at most the static one
  const std::uint8_t* triangle_friction = nullptr;  // triangles; index of a friction
  const float* coefficient =
      nullptr;                  // modes x 6: A - I row by row, then B (position, velocity) per modal force
  const float* load = nullptr;  // modes; constant modal force
  const float* basis_scale = nullptr;   // modes
  const std::int16_t* basis = nullptr;  // (3 nodes) x modes
  // The near field (near_field.hpp); without springs there is none.
  std::size_t springs = 0;
  const float* rest_m = nullptr;              // nodes x 3: where the modes' stiffness is the springs' tangent
  const std::uint8_t* spring_end = nullptr;   // springs x 2, node indices
  const std::uint8_t* spring_kind = nullptr;  // springs
  std::size_t spring_kinds = 0;
  const float* spring_stiffness_N_m = nullptr;  // spring_kinds
  const float* spring_damping_N_s_m = nullptr;  // spring_kinds
  const float* spring_length_m = nullptr;       // spring_kinds, without load

  // The motion of the tip beyond its place at the end of a step at which the contact aims, in steps: 0 to
  // 1/2.
  [[nodiscard]] float target_extrapolation() const {
    return 0.5f - static_cast<float>(target_below_half_16ths) / 16.0f;
  }
};

// The part that changes from tick to tick.
struct ModalState {
  std::array<float, kMaxModes> q{};  // modal positions
  std::array<float, kMaxModes> p{};  // modal velocities
};

// Checks counts against the capacities, indices against counts, friction coefficients against each other, and
// every number for NaN and infinity.
Status check(const LocalModelView& model, const ModalState& state);

}  // namespace palpate
