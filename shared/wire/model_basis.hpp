// The basis of a local model: what does not change from state to state, as bytes that the board uses where
// they lie.
//
// Little-endian. A BasisHeader, then arrays in the order of BasisLayout, each on a multiple of 4 bytes, gaps
// zero. Its identifier is the CRC-32C of all bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/contact/contact_state.hpp"
#include "shared/model/local_model.hpp"
#include "shared/status.hpp"

namespace palpate::wire {

struct BasisHeader {
  std::uint64_t schema_hash;
  std::uint32_t bytes;  // of the whole basis
  std::uint16_t modes;
  std::uint8_t nodes, surface_nodes, triangles, frictions, springs, spring_kinds;
  std::uint8_t surface;  // SurfaceKind
  // The contact's target, in 1/16 tick of the tip's motion below 1/2; at most 8
  // (shared/model/local_model.hpp)
  std::uint8_t target_below_half_16ths;
  std::uint8_t zero[2];
  float origin_m[3];  // of node positions, device frame
  float tip_radius_m;
  float coupling_stiffness_N_m;  // spring between tip and contact point; 0: none
  float coupling_damping_N_s_m;  // damper beside it; >= 0
};
static_assert(sizeof(BasisHeader) == 48);

// Offsets of the arrays, and the length of all, from the counts of a header.
struct BasisLayout {
  std::size_t place_m;      // float, nodes x 3: their rest positions, or where they are at q = 0
  std::size_t coefficient;  // float, modes x 6: a11 a12 a21 a22 b1 b2
  std::size_t basis_scale;  // float, modes
  std::size_t static_friction, kinetic_friction;                            // float, frictions
  std::size_t spring_stiffness_N_m, spring_damping_N_s_m, spring_length_m;  // float, spring_kinds
  std::size_t basis;                                                        // int16, (3 nodes) x modes
  std::size_t triangle_id;                                                  // uint16, triangles
  std::size_t corner;             // uint8, triangles x 3, counter-clockwise seen from outside
  std::size_t triangle_friction;  // uint8, triangles
  std::size_t spring_end;         // uint8, springs x 2
  std::size_t spring_kind;        // uint8, springs
  std::size_t bytes;
};

constexpr BasisLayout basis_layout(std::size_t modes, std::size_t nodes, std::size_t triangles,
                                   std::size_t frictions, std::size_t springs, std::size_t spring_kinds) {
  std::size_t end = sizeof(BasisHeader);
  const auto array = [&end](std::size_t bytes) {
    const std::size_t begin = end;
    end += (bytes + 3) / 4 * 4;
    return begin;
  };
  BasisLayout layout{};
  layout.place_m = array(4 * 3 * nodes);
  layout.coefficient = array(4 * kCoefficientsPerMode * modes);
  layout.basis_scale = array(4 * modes);
  layout.static_friction = array(4 * frictions);
  layout.kinetic_friction = array(4 * frictions);
  layout.spring_stiffness_N_m = array(4 * spring_kinds);
  layout.spring_damping_N_s_m = array(4 * spring_kinds);
  layout.spring_length_m = array(4 * spring_kinds);
  layout.basis = array(2 * 3 * nodes * modes);
  layout.triangle_id = array(2 * triangles);
  layout.corner = array(3 * triangles);
  layout.triangle_friction = array(triangles);
  layout.spring_end = array(2 * springs);
  layout.spring_kind = array(springs);
  layout.bytes = end;
  return layout;
}

// The largest: with as many modes as there may be, and the nodes that the capacity of the basis leaves them.
inline constexpr std::size_t kMaxBasisBytes =
    basis_layout(kMaxModes, kMaxBasis / 3 / kMaxModes, kMaxTriangles, kMaxFrictions, kMaxSprings,
                 kMaxSpringKinds)
        .bytes;

// Reads a basis where it lies: `view` points into `bytes`, which must be aligned to 4; position_m is that of
// the basis, load is missing. Status::schema_mismatch, model_too_large (a count beyond its capacity), or
// model_inconsistent (lengths that do not fit, law out of bounds). Numbers in the arrays are for
// palpate::check(). Any context.
Status open_basis(std::span<const std::uint8_t> bytes, std::uint64_t schema_hash, LocalModelView& view,
                  ContactLaw<float>& law);

// Identifier of a basis: the CRC-32C of its bytes, 1 where that is 0.
std::uint32_t basis_id(std::span<const std::uint8_t> bytes);
// The same from the state of crc32c_update() after all bytes.
std::uint32_t basis_id_of(std::uint32_t crc_state);

}  // namespace palpate::wire
