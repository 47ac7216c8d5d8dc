#include "shared/model/local_model.hpp"

#include <cmath>

namespace palpate {
namespace {

bool all_finite(const float* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(values[i])) return false;
  return true;
}

bool friction_is_valid(const LocalModelView& model) {
  for (std::size_t i = 0; i < model.frictions; ++i)
    if (!(model.kinetic_friction[i] >= 0.0f && model.static_friction[i] >= model.kinetic_friction[i] &&
          std::isfinite(model.static_friction[i])))
      return false;
  for (std::size_t i = 0; i < model.triangles; ++i)
    if (model.triangle_friction[i] >= model.frictions) return false;
  return true;
}

}  // namespace

Status check(const LocalModelView& model, const ModalState& state) {
  if (model.modes > kMaxModes || model.nodes > kMaxSurfaceNodes || model.triangles > kMaxTriangles ||
      model.frictions > kMaxFrictions || 3 * model.nodes * model.modes > kMaxBasis)
    return Status::model_too_large;
  if (model.modes == 0 || model.nodes < 3 || model.triangles == 0) return Status::model_inconsistent;
  for (std::size_t i = 0; i < 3 * model.triangles; ++i)
    if (model.corner[i] >= model.nodes) return Status::model_inconsistent;
  if (!friction_is_valid(model)) return Status::model_inconsistent;
  const bool finite = is_finite(model.origin_m) && all_finite(model.position_m, 3 * model.nodes) &&
                      all_finite(model.coefficient, kCoefficientsPerMode * model.modes) &&
                      all_finite(model.load, model.modes) && all_finite(model.basis_scale, model.modes) &&
                      all_finite(state.q.data(), model.modes) && all_finite(state.p.data(), model.modes);
  return finite ? Status::ok : Status::model_not_finite;
}

}  // namespace palpate
