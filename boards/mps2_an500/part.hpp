// What the firmware on QEMU's mps2-an500 (Cortex-M7) knows of its part.
#pragma once

#include "firmware/core/renderer.hpp"

namespace palpate::board {

inline constexpr firmware::CatchUpPolicy kCatchUp = firmware::kCatchUpCortexM7;

}  // namespace palpate::board
