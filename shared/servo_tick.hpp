// The servo tick: the system's only clock. Every message and record counts it.
#pragma once

namespace palpate {

inline constexpr double kTick_s = 1e-3;

}  // namespace palpate
