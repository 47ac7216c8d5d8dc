// Bases of the whole body by their port nodes: constants of body and ports, computed once and remembered.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <list>
#include <memory>
#include <utility>
#include <vector>

#include "host/linearize/whole_body_basis.hpp"

namespace palpate::host {

// A WholeBodyBasis as it is kept: the large part in single precision, which is finer than the 16 bits that a
// board takes, and half as long to read. Rounding: 6e-8 of each entry.
struct StoredBasis {
  Eigen::VectorXd lambda_rad2_s2;
  Eigen::MatrixXd damping_1_s;
  Eigen::MatrixXf basis_1_sqrt_kg;
};

class BasisStore {
 public:
  // The body must outlive it. Throws as WholeBodyReduction does.
  BasisStore(const Body& body, const std::vector<double>& shift_rad_s) : reduction_(body, shift_rad_s) {}

  // The basis for these ports, in their order; never null. It stays valid for as long as it is held.
  std::shared_ptr<const StoredBasis> basis(const std::vector<int>& ports);

  // Bases that had to be computed so far; the others were remembered.
  [[nodiscard]] std::size_t computed() const { return computed_; }

 private:
  using Entry = std::pair<std::vector<int>, std::shared_ptr<const StoredBasis>>;
  WholeBodyReduction reduction_;
  std::list<Entry> bases_;  // latest used first
  std::size_t computed_ = 0;
};

}  // namespace palpate::host
