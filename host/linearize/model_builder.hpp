// From a state of the body and the contact's place to a local model: one interface, several builders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host/linearize/basis_source.hpp"
#include "host/linearize/local_model.hpp"
#include "host/linearize/model_surface.hpp"
#include "host/linearize/patch_selection.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

class ModelBuilder {
 public:
  ModelBuilder() = default;
  ModelBuilder(const ModelBuilder&) = delete;
  ModelBuilder& operator=(const ModelBuilder&) = delete;
  virtual ~ModelBuilder() = default;

  // How long it takes to prepare for a contact somewhere else; 0 where there is nothing to prepare.
  [[nodiscard]] virtual std::uint32_t foresight_ticks() const { return 0; }
  // The contacts to prepare for, the most urgent first. Ticks do not go back.
  virtual void foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts) {
    (void)tick;
    (void)contacts;
  }

  // A model linearized about the state, or with its forces, around the contact. Without modes: none can be
  // had now. held: nodes, ascending, that are driven. Throws std::invalid_argument where it can't.
  virtual LocalModel build(const BodyState& state, const SurfacePoint& contact,
                           const std::vector<int>& held) = 0;

  // Of the bases that it needed; zeros where it needs none.
  [[nodiscard]] virtual BasisCounts bases() const { return {}; }
  // Models for which a basis was not there yet: they are on the patch before, or were not had.
  [[nodiscard]] virtual std::size_t basis_waits() const { return 0; }
};

enum class Builder {
  patch,           // the paper's: the nodes around the contact with the tangent of the frame, others held
                   // (patch_builder.hpp)
  patch_rescaled,  // the same, the springs that lead out of it softened (surrounded_patch_builder.hpp)
  condensed,       // the patch in the rest of the body, condensed statically (surrounded_patch_builder.hpp)
  krylov,          // modes of the whole body (krylov_builder.hpp)
  hybrid,          // those at rest, and the exact springs at the contact (hybrid_builder.hpp)
};

// Where the body is linearized: at rest, once, or at each frame's state.
enum class TangentAt { rest, frame };

struct BuilderConfig {
  Builder builder = Builder::patch;
  PatchSize patch{};
  TangentAt tangent = TangentAt::frame;      // of krylov; a patch has the frame's
  std::vector<double> shift_rad_s;           // of krylov
  std::vector<double> middle_shift_rad_s{};  // of krylov and hybrid, of the nodes of the contact's cell only
  BasisPolicy bases{};                       // of krylov and hybrid
  int near_nodes = 4;                        // of hybrid
};

// The body must outlive the builder. Models step by step_s. Throws as the builders do.
std::unique_ptr<ModelBuilder> make_builder(const Body& body, const BuilderConfig& config, double step_s);

}  // namespace palpate::host
