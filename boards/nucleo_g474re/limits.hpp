// The supervisor's limits on this board (docs/safety.md, "A board's own limits"). This file makes its folder
// a board that hosts arm.
#pragma once

#include "firmware/core/supervisor.hpp"

namespace palpate::board {

// Those of a PHANTOM 1.5-class arm. Who builds another one sets its currents, speeds and forces here. How
// warm the motors are when power comes on nobody knows: they may have been at their limit a second ago.
inline constexpr firmware::Limits kLimits{.heat_at_start = 1.0f};

}  // namespace palpate::board
