// The state of a local model, quantized to 16 bits (palpate.ModelState says how), and back.
#pragma once

#include <cstdint>

#include "palpate/ModelState_1_0.h"
#include "shared/model/local_model.hpp"

namespace palpate::wire {

inline constexpr float kLargestStateEntry = 32767.0f;

// What a modal number is counted in.
struct ModeUnit {
  float displacement_m;     // of the node that a mode moves most, per modal position
  float stiffness_rad2_s2;  // -a11 / b1: modal force per modal position at rest
};
// basis_scale: of the mode. coefficient: its kCoefficientsPerMode numbers. Any context.
ModeUnit mode_unit(float basis_scale, const float* coefficient);

// True where the counts of the arrays are those of a model with so many modes and nodes, or 0.
bool counts_agree(const palpate_ModelState_1_0& message, const LocalModelView& basis);

// The state in the message, for the basis that it names; its counts must agree. position_m: 3 x nodes,
// load: modes. A node is off from where the sender had it by at most half of displacement_step_m, and modes x
// half of q_step_m; its velocity by modes x half of p_step_m_s; what the load moves it at rest by modes x
// half of load_step_m, where no mode is softer than 40 / s^2. The same numbers to the bit everywhere. Any
// context.
void read_state(const palpate_ModelState_1_0& message, const LocalModelView& basis, float* position_m,
                float* load, ModalState& state);

}  // namespace palpate::wire
