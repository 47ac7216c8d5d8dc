// The largest stable step of the semi-implicit Euler method.
//
// For M x'' + D x' + K x = 0 the method (semi_implicit_euler.hpp) is
//   M (x+ - 2 x + x-) / h^2 + D (x - x-) / h + K x = 0.
// With z an amplification factor, u its complex mode shape, and m, d, k the Rayleigh values u* M u, u* D u,
// u* K u:
//   m z^2 - (2 m - h d - h^2 k) z + (m - h d) = 0,
// whose roots lie in the unit circle (Jury) exactly where h^2 k + 2 h d < 4 m. It is enough to hold this for
// every u:
//   h < 4 / (d' + sqrt(d'^2 + 4 k')),   k' >= largest eigenvalue of M^-1 K,  d' >= largest of M^-1 D.
// Bounds k' and d' come from the springs: a spring's block S obeys (a - b)' S (a - b) <= 2 a' S a + 2 b' S b,
// so K is at most the block diagonal matrix with 2 S for each spring to a free node and S for each to a fixed
// one; the largest eigenvalue of a 3x3 block is at most its largest absolute row sum (Gershgorin). In a
// lattice's interior both bounds are met by the mode in which neighbours move against each other.
#pragma once

#include <Eigen/Core>

#include "host/msd/body.hpp"

namespace palpate::host {

// Safe step of the linear motion about `position_m` (3 x nodes), the body momentarily at rest there;
// stretched springs count with their geometric stiffness, the negative one of compressed springs is left out.
// Infinite where nothing is free to move.
double stable_step_s(const Body& body, const Eigen::Matrix3Xd& position_m);

}  // namespace palpate::host
