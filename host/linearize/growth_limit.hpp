// How fast a mode of a local model may grow.
//
// Compressed springs can make the tangent indefinite: a mode with lambda < 0 grows as exp(s t) with
//   s = (sqrt(d^2 - 4 lambda) - d) / 2,
// as the body does at first, until its geometry stops it. A linear model has nothing that stops it. So within
// the time for which the model may be rendered a deviation may grow to kLargestGrowth times itself and no
// more: lambda is raised to -s' (s' + d), s' = ln(kLargestGrowth) / time. Of the mode's compliance
// g = 1 / (lambda - w^2 + i w d) at a frequency w that changes a part of |g'| (lambda' - lambda), at most
// (lambda' - lambda) / (w d): most of what is slow, little of what is fast.
#pragma once

#include "host/linearize/local_model.hpp"

namespace palpate::host {

// A tenth of a millimetre becomes a millimetre.
inline constexpr double kLargestGrowth = 10.0;

// The least lambda that a mode may have, for a time in which the model may be rendered; negative.
double least_lambda_rad2_s2(double damping_rad_s, double time_s);

// Raises lambda of the modes that grow faster, sets their coefficients anew and counts them
// (LocalModel::limited_modes). The model's step_s is set.
void limit_growth(LocalModel& model, double time_s);

}  // namespace palpate::host
