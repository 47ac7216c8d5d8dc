// What the contact of the tip with a surface remembers from step to step.
#pragma once

#include <cstdint>

#include "shared/contact/coupling.hpp"
#include "shared/math/linear.hpp"

namespace palpate {

// Values travel over the link (palpate.Contact MODE_*): never renumber them.
enum class ContactMode : std::uint8_t { free = 0, stick = 1, slip = 2 };

template <class Real>
struct ContactState {
  ContactMode mode = ContactMode::free;
  std::uint32_t triangle = 0;  // index in the surface; only with mode != free
  Vec3<Real> barycentric{};    // contact point on it; weights of its corners, sum 1
  Vec3<Real> force_N{};        // of the tip on the body during the last step
  Vec3<Real> normal{};         // unit outward normal in which that force was found; when free, the last one
  Vec3<Real> stretch_m{};      // of the coupling; zero where it does not yield, and when free
  // What the contact leaves open between the surface's contact point and the tip:
  Real inset_m = 0;  // inward, what is left of a start inside the body
  Vec3<Real>
      overhang_m{};  // along the surface: beyond its border, or where a start inside the body was askew
  // Of a smooth surface over its triangle, along the normal (slide.hpp). Kept for a while after separation,
  // while `outside` holds; otherwise 0 when free.
  Real height_m = 0;
  Real lean = 0;  // share of the height's forgetting that the normal of the newest step took on (slide.hpp)
  bool outside =
      false;  // mode == free: the tip has been seen outside, so crossing the surface is a collision
  bool at_border = false;  // the contact point was held at the border of the surface known here
};

// Coulomb's coefficients of one place of a surface: static_coefficient >= kinetic_coefficient >= 0.
template <class Real>
struct Friction {
  Real static_coefficient = 0;
  Real kinetic_coefficient = 0;
  friend bool operator==(const Friction&, const Friction&) = default;
};

// What the tip brings to the contact; friction belongs to the surface. tip_radius_m >= 0.
template <class Real>
struct ContactLaw {
  Real tip_radius_m = 0;
  Coupling<Real> coupling{};
};

}  // namespace palpate
