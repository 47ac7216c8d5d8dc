// The paper's patch with surroundings that yield: two ways to put the rest of the body around it, at rest,
// once for each patch. Stiffness and damping of the patch itself are those of the frame (patch_builder.hpp).
//
// rescaled: the springs and dampers that lead out of the patch, their far ends held, times one factor
//   (StaticSurroundings::spring_factor). "Extending the outer layer of springs and dampers to the outer edges
//   of the body and suitably scaling their parameters" (Jacobs, Fu, Cavusoglu 2010, section 6), which gives
//   no rule; here the patch's border nodes yield on average as they do in the body.
// condensed: the stiffness of the rest of the body, statically (Schur complement): exact at 0 Hz. Dampers
//   with their far ends held, masses the patch's own: docs/decisions/whole_body.md compares others.
#pragma once

#include <list>
#include <utility>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/linearize/model_surface.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/linearize/static_surroundings.hpp"

namespace palpate::host {

enum class SurroundedBy { rescaled, condensed };

class SurroundedPatchBuilder final : public ModelBuilder {
 public:
  // The body must outlive it. Throws std::invalid_argument as StaticSurroundings does.
  SurroundedPatchBuilder(const Body& body, const PatchSize& patch, SurroundedBy by, double step_s,
                         const LocalModelCapacity& capacity = {});

  // Throws std::invalid_argument for held nodes: the surroundings are those of a body in which they are free.
  LocalModel build(const BodyState& state, const SurfacePoint& contact,
                   const std::vector<int>& held) override;

 private:
  using Entry = std::pair<std::vector<int>, Surroundings>;  // nodes of the patch
  const Surroundings& around(const std::vector<int>& nodes);

  const Body& body_;
  PatchSize patch_;
  SurroundedBy by_;
  double step_s_;
  LocalModelCapacity capacity_;
  StaticSurroundings body_around_;
  std::list<Entry> known_;  // latest used first
};

}  // namespace palpate::host
