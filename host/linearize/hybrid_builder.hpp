// Local models with a linear far field and an exact near field: the whole body's modes at rest, and the
// springs at the contact, whose exact forces the board computes (shared/model/near_field.hpp,
// docs/decisions/near_field.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host/linearize/krylov_builder.hpp"
#include "host/linearize/model_builder.hpp"

namespace palpate::host {

class HybridBuilder final : public ModelBuilder {
 public:
  // The body must outlive it. near_nodes: below the surface, whose answers to forces are in the modes.
  // middle_shift_rad_s: as of Shifts; all nodes have the static answers. Throws as KrylovBuilder does.
  HybridBuilder(const Body& body, const PatchSize& patch, int near_nodes,
                const std::vector<double>& middle_shift_rad_s, double step_s,
                const LocalModelCapacity& capacity = {}, const BasisPolicy& bases = {})
      : body_(body),
        capacity_(capacity),
        far_(body, patch, TangentAt::rest, Shifts({0.0}, middle_shift_rad_s), step_s, capacity, bases,
             near_nodes) {}

  [[nodiscard]] std::uint32_t foresight_ticks() const override { return far_.foresight_ticks(); }
  void foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts) override {
    far_.foresee(tick, contacts);
  }
  [[nodiscard]] BasisCounts bases() const override { return far_.bases(); }
  [[nodiscard]] std::size_t basis_waits() const override { return far_.basis_waits(); }

  // Throws as KrylovBuilder::build does.
  LocalModel build(const BodyState& state, const SurfacePoint& contact,
                   const std::vector<int>& held) override;

 private:
  const Body& body_;
  LocalModelCapacity capacity_;
  KrylovBuilder far_;
};

}  // namespace palpate::host
