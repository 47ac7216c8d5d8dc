// The exact answer of the full linear body to forces at points of its surface, at any frequency: what local
// models are measured against (compliance_error.hpp).
//
// With K, B the tangent at a state and M the masses, (K + i w B - w^2 M) x = e is solved for the force e of
// each point and axis. Galerkin's method in a real span that grows with each frequency that it does not hold
// yet; the residual, preconditioned with the Cholesky factor of K0 + w B0 + w^2 M of the body at rest, gives
// the new directions. For a symmetric tangent the error of the compliance at a point is c' r, c the column of
// displacements and r the residual (both for unit force there), so at most |c| |r|: that decides. Dampers in
// motion make K slightly unsymmetric; the bound is then an estimate.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// One object per thread.
class BodyResponse {
 public:
  // Linearized at the state, about which it keeps no reference. Throws std::invalid_argument for a body with
  // a motion that no spring resists at rest, a planar body or no points.
  BodyResponse(const Body& body, const BodyState& state, std::vector<SurfacePoint> points);
  ~BodyResponse();
  BodyResponse(const BodyResponse&) = delete;
  BodyResponse& operator=(const BodyResponse&) = delete;

  // Displacement of each point under unit forces on itself, m / N, relative error at most 1e-6. Throws
  // std::runtime_error where it does not converge: a body without damping at a resonance.
  std::vector<Eigen::Matrix3cd> compliance(double frequency_rad_s);

 private:
  struct Solver;
  std::unique_ptr<Solver> solver_;
};

}  // namespace palpate::host
