// The inner loops over springs, written so that the compiler vectorizes them.
//
// A band is a run of springs i -> i + offset over consecutive nodes i with equal constants, as regular
// lattices have 13 of them; `present` is 1 where the spring exists and 0 where it does not (where i + offset
// wraps to another row). Every loop does the same IEEE operations per spring on any instruction set, so
// results do not depend on the machine.
#pragma once

#include <cstddef>

namespace palpate::host {

struct BandView {
  std::ptrdiff_t first = 0;         // first node i
  std::ptrdiff_t count = 0;         // springs, present or not
  std::ptrdiff_t offset = 0;        // j - i > 0
  const double* present = nullptr;  // count
  double stiffness_N_m = 0;
  double damping_N_s_m = 0;
  double rest_length_m = 0;
};

// Node components by axis; index is the node.
struct NodalView {
  const double* x = nullptr;
  const double* y = nullptr;
  const double* z = nullptr;
};
struct MutableNodalView {
  double* x = nullptr;
  double* y = nullptr;
  double* z = nullptr;
};

// A band's springs linearized for an implicit step: with direction n, the block of a spring is
//   axial n n' + transverse (I - n n'),  axial the same for the whole band.
struct LinearBandView {
  std::ptrdiff_t first = 0;
  std::ptrdiff_t count = 0;
  std::ptrdiff_t offset = 0;
  double axial = 0;
  double* direction_x = nullptr;  // count each; zero where no spring is present
  double* direction_y = nullptr;
  double* direction_z = nullptr;
  double* transverse = nullptr;
};

// Weights of an implicit step's matrix: stiffness_weight * (-df/dX) + damping_weight * (-df/dV).
struct LinearWeights {
  double stiffness = 0;
  double damping = 0;
  bool only_stretched = false;  // leaves out the negative transverse stiffness of compressed springs
};

// Adds the band's spring and damper forces to force_N.
void add_band_forces(const BandView& band, const NodalView& position_m, const NodalView& velocity_m_s,
                     const MutableNodalView& force_N);

// Fills the direction and transverse arrays of `linear` at the given state. Of the damper's dependence on
// direction, (b / length) (n (P u)' + (u . n) P) with P = I - n n' and u the relative velocity, only the
// second part enters, which keeps the matrix symmetric.
void linearize_band(const BandView& band, const LinearWeights& weights, const NodalView& position_m,
                    const NodalView& velocity_m_s, const LinearBandView& linear);

// product += (sum of the band's blocks) operand.
void apply_band(const LinearBandView& linear, const NodalView& operand, const MutableNodalView& product);

}  // namespace palpate::host
