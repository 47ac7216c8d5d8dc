// What the firmware on QEMU's mps2-an500 (Cortex-M7) knows of its part.
#pragma once

#include <string_view>

#include "firmware/core/renderer.hpp"

namespace palpate::board {

inline constexpr std::string_view kBoardName = "mps2_an500";
inline constexpr firmware::CatchUpPolicy kCatchUp = firmware::kCatchUpCortexM7;

}  // namespace palpate::board
