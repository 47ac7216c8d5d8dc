// Random situations of the contact on a local model, for measuring what a tick of it costs. The same on every
// machine: integers from a seeded generator.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/math/lcg.hpp"
#include "shared/math/linear.hpp"
#include "shared/model/local_model.hpp"
#include "shared/model/modal_surface.hpp"

namespace palpate::bench {

// Models that fill the basis.
enum class ModelSize : std::uint8_t { modes_96_nodes_32 = 0, modes_192_nodes_16 = 1, near_field = 2 };
inline constexpr std::size_t kModelSizes = 3;
inline constexpr SurfaceKind kSurfaces[] = {SurfaceKind::smooth, SurfaceKind::flat};

// What a tick was. A slip that ends on another triangle is an edge crossing.
enum class TickKind : std::uint8_t {
  free = 0,
  first_contact = 1,
  stick = 2,
  slip = 3,
  edge_crossing = 4,
  separation = 5
};
inline constexpr std::size_t kTickKinds = 6;

// Situation `number` of a size and surface: a model (a new one every kSituationsPerModel), moving by up to
// some millimetres, with a tip that is free or in contact with one of its triangles, point or sphere, with
// friction 0 to 1. Nothing is known from ticks before: the first step is dearer than what usually follows.
// Too large for a microcontroller's stack.
class ContactSituations {
 public:
  static constexpr std::uint32_t kSituationsPerModel = 500;

  void prepare(ModelSize size, SurfaceKind surface, std::uint32_t number);

  // The tick to be measured: step_contact and nothing else.
  void step();
  // After step(): what it was. The tip then goes on in the same direction.
  TickKind finish();
  [[nodiscard]] const ContactState<float>& contact() const { return contact_; }

 private:
  void build_model(ModelSize size, SurfaceKind surface, std::uint32_t number);
  void connect_neighbours();
  void place_tip(Lcg& random);

  std::array<float, 3 * kMaxSurfaceNodes> position_m_{}, rest_m_{};
  std::array<std::uint8_t, 2 * kMaxSprings> spring_end_{};
  std::array<std::uint8_t, kMaxSprings> spring_kind_{};
  std::array<std::uint8_t, 3 * kMaxTriangles> corner_{};
  std::array<std::uint16_t, kMaxTriangles> triangle_id_{};
  Friction<float> friction_{};  // of all triangles
  std::array<std::uint8_t, kMaxTriangles> triangle_friction_{};
  std::array<float, kCoefficientsPerMode * kMaxModes> coefficient_{};
  std::array<float, kMaxModes> load_{};
  std::array<float, kMaxModes> basis_scale_{};
  std::array<std::int16_t, kMaxBasis> basis_{};
  LocalModelView view_{};
  ModalState state_{};
  ModalSurface surface_{};
  ContactLaw<float> law_{};
  ContactState<float> before_{}, contact_{};
  Vec3f from_m_{}, to_m_{};
  bool built_ = false;
  ModelSize built_size_{};
  SurfaceKind built_surface_{};
  std::uint32_t built_number_ = 0;
};

}  // namespace palpate::bench
