// A mode stepped by backward Euler: for made-up models on the board, which has no exponential function.
#pragma once

#include "shared/model/local_model.hpp"
#include "shared/servo_tick.hpp"

namespace palpate {

// Coefficients (a11 - 1, a12, a21, a22 - 1, b1, b2; kCoefficientsPerMode numbers) of one servo tick of
// q'' = -lambda q - d q' + u: p' = (p - h lambda q + h u) / (1 + h d + h^2 lambda), q' = q + h p'. Divisions
// only: the same bits everywhere. Any context.
inline void backward_euler_mode(float lambda_rad2_s2, float damping_rad_s, float* coefficient) {
  constexpr float kStep_s = static_cast<float>(kTick_s);
  const float inverse = 1.0f / (1.0f + kStep_s * damping_rad_s + kStep_s * kStep_s * lambda_rad2_s2);
  coefficient[2] = -(kStep_s * lambda_rad2_s2) * inverse;
  coefficient[3] = inverse - 1.0f;
  coefficient[5] = kStep_s * inverse;
  coefficient[0] = kStep_s * coefficient[2];
  coefficient[1] = kStep_s * inverse;
  coefficient[4] = kStep_s * coefficient[5];
}

}  // namespace palpate
