// Friction over the surface of a body: one pair of coefficients, and others within boxes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "host/msd/body.hpp"
#include "shared/contact/contact_state.hpp"

namespace palpate::host {

// An axis-aligned box in the device frame, laid over the body at rest.
struct FrictionRegion {
  Vec3d from_m{}, to_m{};
  Friction<double> friction{};
};

struct FrictionSpec {
  Friction<double> elsewhere{};
  std::vector<FrictionRegion> regions;
};

// The friction of each triangle. A triangle belongs to the last region whose box holds its centroid at rest.
class SurfaceFriction {
 public:
  // Throws std::invalid_argument, naming the region, the value and the allowed range, for a box with from_m
  // beyond to_m, coefficients that are not 0 <= kinetic <= static < infinity, and more than kMaxFrictions
  // different pairs of them.
  SurfaceFriction(const Body& body, const FrictionSpec& spec);

  [[nodiscard]] const Friction<double>& of(std::uint32_t triangle) const {
    return different_[index_[triangle]];
  }
  // The different pairs, and which of them a triangle has.
  [[nodiscard]] std::span<const Friction<double>> different() const { return different_; }
  [[nodiscard]] std::uint8_t index(std::uint32_t triangle) const { return index_[triangle]; }

 private:
  std::vector<Friction<double>> different_;
  std::vector<std::uint8_t> index_;  // per triangle
};

}  // namespace palpate::host
