#include "host/linearize/hybrid_builder.hpp"

#include "host/linearize/near_springs.hpp"

namespace palpate::host {

LocalModel HybridBuilder::build(const BodyState& state, const SurfacePoint& contact,
                                const std::vector<int>& held) {
  LocalModel model = far_.build(state, contact, held);
  if (model.modes() > 0) add_near_field(model, body_, state, capacity_);
  return model;
}

}  // namespace palpate::host
