// What the firmware on QEMU's mps2-an386 (Cortex-M4F) knows of its part.
#pragma once

#include "firmware/core/renderer.hpp"

namespace palpate::board {

inline constexpr firmware::CatchUpPolicy kCatchUp = firmware::kCatchUpCortexM4;

}  // namespace palpate::board
