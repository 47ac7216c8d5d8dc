// A basis as it is kept and used on-line.
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "host/linearize/whole_body_basis.hpp"

namespace palpate::host {

// A WholeBodyBasis with the large part in single precision, which is finer than the 16 bits that a board
// takes, and half as long to read. Rounding: 6e-8 of each entry.
struct StoredBasis {
  Eigen::VectorXd lambda_rad2_s2;
  Eigen::MatrixXd damping_1_s;
  Eigen::MatrixXf basis_1_sqrt_kg;  // degrees of freedom x modes

  [[nodiscard]] std::size_t bytes() const {
    return sizeof(double) * static_cast<std::size_t>(lambda_rad2_s2.size() + damping_1_s.size()) +
           sizeof(float) * static_cast<std::size_t>(basis_1_sqrt_kg.size());
  }
};

inline StoredBasis stored(const WholeBodyBasis& basis) {
  return {basis.lambda_rad2_s2, basis.damping_1_s, basis.basis_1_sqrt_kg.cast<float>()};
}

}  // namespace palpate::host
