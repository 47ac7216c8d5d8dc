// Where the contact has to aim for the force of a steadily moving tip to be the body's mean of the tick
// (docs/decisions/contact_output.md, "Stiff bodies").
#pragma once

#include <cstdint>

#include "host/linearize/local_model.hpp"

namespace palpate::host {

// The motion of the tip beyond its place at the end of a tick, in ticks:
//   e = [sum w (q + h p / 2) + C1 / h] / C0 - 1/2,   (q, p) = (A - I)^-1 ((1 / lambda, 0) - B)
// over the model's modes, with C0 = sum w / lambda and C1 = sum w d / lambda^2. w: of each mode the sum of
// its squares at the nodes of the surface: the mean of their compliances. 1/2 for modes slow against the
// tick, -1/2 for such as are over within it. 1/2 where a mode does not come back (lambda <= 0): then nothing
// is steady.
double centred_target_ticks(const LocalModel& model);

// The same as the basis carries it: 1/16 below 1/2, from 0 to kMaxTargetBelowHalf_16ths.
std::uint8_t target_below_half_16ths(const LocalModel& model);

}  // namespace palpate::host
