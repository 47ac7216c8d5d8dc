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

// What the near field takes from its springs' numbers is checked where it would divide or not end.
bool near_field_is_valid(const LocalModelView& model) {
  if (model.springs == 0) return true;
  for (std::size_t s = 0; s < model.springs; ++s) {
    const std::uint8_t i = model.spring_end[2 * s], j = model.spring_end[2 * s + 1];
    if (i >= model.nodes || j >= model.nodes || i == j || model.spring_kind[s] >= model.spring_kinds)
      return false;
  }
  for (std::size_t k = 0; k < model.spring_kinds; ++k)
    if (!(model.spring_stiffness_N_m[k] >= 0.0f && model.spring_damping_N_s_m[k] >= 0.0f &&
          model.spring_length_m[k] >= 0.0f))
      return false;
  return true;
}

}  // namespace

Status check(const LocalModelView& model, const ModalState& state) {
  if (model.modes > kMaxModes || model.nodes > kMaxSurfaceNodes || model.triangles > kMaxTriangles ||
      model.frictions > kMaxFrictions || model.springs > kMaxSprings ||
      model.spring_kinds > kMaxSpringKinds || (model.springs != 0 && model.modes > kMaxNearModes) ||
      3 * model.nodes * model.modes > kMaxBasis)
    return Status::model_too_large;
  if (model.modes == 0 || model.surface_nodes < 3 || model.surface_nodes > model.nodes ||
      model.triangles == 0)
    return Status::model_inconsistent;
  for (std::size_t i = 0; i < 3 * model.triangles; ++i)
    if (model.corner[i] >= model.surface_nodes) return Status::model_inconsistent;
  if (!friction_is_valid(model) || !near_field_is_valid(model)) return Status::model_inconsistent;
  const bool finite = is_finite(model.origin_m) && all_finite(model.position_m, 3 * model.nodes) &&
                      all_finite(model.rest_m, model.springs == 0 ? 0 : 3 * model.nodes) &&
                      all_finite(model.spring_stiffness_N_m, model.spring_kinds) &&
                      all_finite(model.spring_damping_N_s_m, model.spring_kinds) &&
                      all_finite(model.spring_length_m, model.spring_kinds) &&
                      all_finite(model.coefficient, kCoefficientsPerMode * model.modes) &&
                      all_finite(model.load, model.modes) && all_finite(model.basis_scale, model.modes) &&
                      all_finite(state.q.data(), model.modes) && all_finite(state.p.data(), model.modes);
  return finite ? Status::ok : Status::model_not_finite;
}

}  // namespace palpate
