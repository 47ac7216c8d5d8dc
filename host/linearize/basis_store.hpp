// Bases of the whole body by their port nodes: constants of body and ports, computed once and remembered.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <utility>
#include <vector>

#include "host/linearize/whole_body_basis.hpp"

namespace palpate::host {

class BasisStore {
 public:
  // The body must outlive it. Throws as WholeBodyReduction does.
  BasisStore(const Body& body, const std::vector<double>& shift_rad_s) : reduction_(body, shift_rad_s) {}

  // The basis for these ports, in their order; never null. It stays valid for as long as it is held.
  std::shared_ptr<const WholeBodyBasis> basis(const std::vector<int>& ports);

  // Bases that had to be computed so far; the others were remembered.
  [[nodiscard]] std::size_t computed() const { return computed_; }

 private:
  using Entry = std::pair<std::vector<int>, std::shared_ptr<const WholeBodyBasis>>;
  WholeBodyReduction reduction_;
  std::list<Entry> bases_;  // latest used first
  std::size_t computed_ = 0;
};

}  // namespace palpate::host
