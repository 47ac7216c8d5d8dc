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
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/linearize/patch_bases.hpp"
#include "host/linearize/stored_basis.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/tangent.hpp"

namespace palpate::host {

class KrylovBuilder final : public ModelBuilder {
 public:
  // The body must outlive it. near_nodes: below the patch's surface, in the span too (hybrid_builder.hpp).
  // at: whose stiffness and damping. shifts as for WholeBodyReduction.
  // Throws as it does, and where a patch of this size may have more modes than the capacity.
  KrylovBuilder(const Body& body, const PatchSize& patch, TangentAt at, const Shifts& shifts, double step_s,
                const LocalModelCapacity& capacity = {}, const BasisPolicy& bases = {}, int near_nodes = 0);

  [[nodiscard]] std::uint32_t foresight_ticks() const override;
  void foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts) override {
    patches_.foresee(tick, contacts);
  }

  // Throws std::invalid_argument for held nodes: the basis is that of a body in which they are free.
  LocalModel build(const BodyState& state, const SurfacePoint& contact,
                   const std::vector<int>& held) override;

  [[nodiscard]] BasisCounts bases() const override { return patches_.source().counts(); }
  [[nodiscard]] std::size_t basis_waits() const override { return patches_.waits(); }

 private:
  // What of a model is a constant of body and patch as long as the tangent is that at rest.
  struct AtRest {
    std::shared_ptr<const StoredBasis> span;
    std::vector<int> nodes;  // of the patch
    LocalModel model;        // without surface and state
  };
  const AtRest& at_rest(std::shared_ptr<const StoredBasis> span, const std::vector<int>& nodes);
  [[nodiscard]] LocalModel of_frame(const BodyState& state, const StoredBasis& span,
                                    const std::vector<int>& nodes, Eigen::MatrixXd& modes);
  // Phi' f0 and Phi' M V0, modes x 2.
  [[nodiscard]] Eigen::MatrixXd projected(const BodyState& state, const StoredBasis& span);

  const Body& body_;
  TangentAt at_;
  double step_s_;
  LocalModelCapacity capacity_;
  int port_limit_;
  PatchBases patches_;
  AtRest at_rest_;
  ForceEvaluator forces_;
  Eigen::Matrix3Xd force_N_;
  Eigen::MatrixXd excitation_;  // degrees of freedom x 2: forces, momenta
  TangentChanges bent_;
  std::vector<TangentChange> changes_;
};

}  // namespace palpate::host
