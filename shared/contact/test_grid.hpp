// Triangles over a square grid of nodes, for the surfaces that tests make up.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "shared/contact/contact_surface.hpp"

namespace palpate::test {

// The triangle across the edge of `t` opposite to corner `c`, as ContactSurface has it; kNoTriangle at a
// border.
inline std::int32_t neighbour_across(const std::vector<std::array<std::uint32_t, 3>>& corners,
                                     std::uint32_t t, std::uint32_t c) {
  const std::uint32_t start = corners[t][(c + 1) % 3], end = corners[t][(c + 2) % 3];
  for (std::uint32_t other = 0; other < corners.size(); ++other)
    for (std::uint32_t k = 0; k < 3; ++k)
      if (corners[other][k] == end && corners[other][(k + 1) % 3] == start)
        return static_cast<std::int32_t>(other);
  return kNoTriangle;
}

// `side` x `side` nodes, row by row; two triangles a cell, counter-clockwise seen from above.
class GridTriangles {
 public:
  explicit GridTriangles(std::uint32_t side) {
    for (std::uint32_t j = 0; j + 1 < side; ++j)
      for (std::uint32_t i = 0; i + 1 < side; ++i) {
        const std::uint32_t a = j * side + i;
        corners_.push_back({a, a + 1, a + side + 1});
        corners_.push_back({a, a + side + 1, a + side});
      }
  }
  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(corners_.size()); }
  [[nodiscard]] const std::array<std::uint32_t, 3>& operator[](std::uint32_t t) const { return corners_[t]; }
  [[nodiscard]] auto begin() const { return corners_.begin(); }
  [[nodiscard]] auto end() const { return corners_.end(); }
  // Across the edge opposite to corner `c`, as ContactSurface has it.
  [[nodiscard]] std::int32_t neighbour(std::uint32_t t, std::uint32_t c) const {
    return neighbour_across(corners_, t, c);
  }

 private:
  std::vector<std::array<std::uint32_t, 3>> corners_;
};

}  // namespace palpate::test
