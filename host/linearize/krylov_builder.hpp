// Local models of the whole body: its modes as the patch's surface nodes excite them (whole_body_basis.hpp).
//
// The span of the modes is a constant of body and patch. Of the state of a frame enters where the nodes are,
// how they move, which forces are on them and, with the tangent of the frame, how stiff the body has become.
// With X0, V0 the state, f0 = f(X0, V0) the non-linear forces without contact and K, B the tangent at rest or
// there, made diagonal within the span,
//   p' = Phi' (f0 - K x - B (v - V0) + f) = -lambda q - d p + load + Phi' f,   load = Phi' f0 + d p0,
// with x = X - X0 = Phi q, v = Phi p and p0 = Phi' M V0. At the start the modes' acceleration is that of the
// non-linear body.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <utility>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/linearize/whole_body_basis.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {

class KrylovBuilder final : public ModelBuilder {
 public:
  // The body must outlive it. at: whose stiffness and damping. shift_rad_s as for WholeBodyReduction.
  // Throws as it does, and where a patch of this size may have more modes than the capacity.
  KrylovBuilder(const Body& body, const PatchSize& patch, TangentAt at,
                const std::vector<double>& shift_rad_s, double step_s,
                const LocalModelCapacity& capacity = {});

  // Throws std::invalid_argument for held nodes: the basis is that of a body in which they are free.
  LocalModel build(const BodyState& state, const SurfacePoint& contact,
                   const std::vector<int>& held) override;

  // Bases that had to be computed so far; the others were remembered.
  [[nodiscard]] std::size_t computed() const { return computed_; }

 private:
  using Entry = std::pair<std::vector<int>, WholeBodyBasis>;  // surface nodes of the patch
  const WholeBodyBasis& basis(const std::vector<int>& surface);

  const Body& body_;
  PatchSize patch_;
  TangentAt at_;
  double step_s_;
  LocalModelCapacity capacity_;
  int port_limit_;
  WholeBodyReduction reduction_;
  ForceEvaluator forces_;
  Eigen::Matrix3Xd force_N_;
  Eigen::MatrixXd excitation_;  // degrees of freedom x 2: forces, momenta
  TangentChanges bent_;
  std::vector<TangentChange> changes_;
  std::list<Entry> bases_;  // latest used first
  std::size_t computed_ = 0;
};

}  // namespace palpate::host
