// A few modes of the whole body that answer forces on a few of its nodes as the whole body does.
//
// Galerkin's method on attachment modes of the nodes' degrees of freedom: the displacements X = (K + s B +
// s^2 M)^-1 E under unit forces E there, at some real frequencies s, for the body at rest without load. With
// s = 0 among them the static answer is exact; each other s makes two more terms of the answer around it
// exact (rational Krylov: Grimme 1997). Then Rayleigh and Ritz: K in the span of X, diagonalized. Source of
// the idea: Jacobs, Fu, Cavusoglu 2010, section 6 (what its patch leaves out of the body); accuracy:
// docs/decisions/whole_body.md.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <initializer_list>
#include <memory>
#include <utility>
#include <vector>

#include "host/msd/body.hpp"

namespace palpate::host {

// x = Phi q of all degrees of freedom (Body::dof), Phi' M Phi = I, Phi' K Phi = diag(lambda).
struct WholeBodyBasis {
  Eigen::VectorXd lambda_rad2_s2;   // ascending
  Eigen::MatrixXd damping_1_s;      // Phi' B Phi
  Eigen::MatrixXd basis_1_sqrt_kg;  // Phi: degrees of freedom x modes
};

// The frequencies s, in rad / s: those at which all nodes are answered, and those at which only the first
// kMiddlePorts are: the nodes in the middle, where the contact is, need more of them than those around.
inline constexpr int kMiddlePorts = 4;
struct Shifts {
  Shifts(std::vector<double> all, std::vector<double> middle = {})
      : all_rad_s(std::move(all)), middle_rad_s(std::move(middle)) {}
  Shifts(std::initializer_list<double> all) : all_rad_s(all) {}

  // The most modes that so many nodes can have, with 3 degrees of freedom each.
  [[nodiscard]] int most_modes(int nodes) const {
    return 3 * (nodes * static_cast<int>(all_rad_s.size()) +
                std::min(nodes, kMiddlePorts) * static_cast<int>(middle_rad_s.size()));
  }

  std::vector<double> all_rad_s, middle_rad_s;
};

// Throws std::invalid_argument for frequencies that are not real, not negative and ascending, or none for
// all.
void require_shifts(const Shifts& shifts);

// Factors of the body at rest, once for each frequency. One object per thread. The body must outlive it.
class WholeBodyReduction {
 public:
  // Throws as require_shifts, and std::invalid_argument for a body with a motion that no spring resists.
  WholeBodyReduction(const Body& body, const Shifts& shifts);
  ~WholeBodyReduction();
  WholeBodyReduction(const WholeBodyReduction&) = delete;
  WholeBodyReduction& operator=(const WholeBodyReduction&) = delete;

  // At most Shifts::most_modes; fewer where some say the same. Fixed nodes are left out. No free node: no
  // modes.
  [[nodiscard]] WholeBodyBasis reduce(const std::vector<int>& nodes) const;

 private:
  struct Factors;
  const Body& body_;
  std::unique_ptr<Factors> factors_;
};

}  // namespace palpate::host
