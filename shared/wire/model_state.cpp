#include "shared/wire/model_state.hpp"

namespace palpate::wire {
namespace {

// (1 Hz)^2: what moves slower hardly moves before the next state comes.
constexpr float kSoftest_rad2_s2 = 40.0f;

template <class Array>
float entry(const Array& array, std::size_t i) {
  return array.count == 0 ? 0.0f : static_cast<float>(array.elements[i]);
}

}  // namespace

ModeUnit mode_unit(float basis_scale, const float* coefficient) {
  const float displacement_m = basis_scale > 0.0f ? kLargestStateEntry * basis_scale : 1.0f;
  // Not for coefficients that are no model's: the numbers stay finite.
  const float stiffness = coefficient[4] > 0.0f ? -coefficient[0] / coefficient[4] : kSoftest_rad2_s2;
  return {displacement_m, stiffness > kSoftest_rad2_s2 ? stiffness : kSoftest_rad2_s2};
}

bool counts_agree(const palpate_ModelState_1_0& message, const LocalModelView& basis) {
  const auto agrees = [](std::size_t count, std::size_t expected) { return count == 0 || count == expected; };
  return agrees(message.displacement.count, 3 * basis.nodes) && agrees(message.load.count, basis.modes) &&
         agrees(message.q.count, basis.modes) && agrees(message.p.count, basis.modes);
}

void read_state(const palpate_ModelState_1_0& message, const LocalModelView& basis, float* position_m,
                float* load, ModalState& state) {
  for (std::size_t i = 0; i < 3 * basis.nodes; ++i)
    position_m[i] = basis.position_m[i] + message.displacement_step_m * entry(message.displacement, i);
  for (std::size_t m = 0; m < basis.modes; ++m) {
    const ModeUnit unit = mode_unit(basis.basis_scale[m], basis.coefficient + kCoefficientsPerMode * m);
    const float per_m = 1.0f / unit.displacement_m;
    state.q[m] = message.q_step_m * entry(message.q, m) * per_m;
    state.p[m] = message.p_step_m_s * entry(message.p, m) * per_m;
    load[m] = message.load_step_m * entry(message.load, m) * (unit.stiffness_rad2_s2 * per_m);
  }
}

}  // namespace palpate::wire
