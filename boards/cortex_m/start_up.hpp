// From reset to run_firmware() on a Cortex-M with an FPU (start_up.cpp); a board adds its vectors.
#pragma once

#include <cstdint>

extern "C" {
// Defined by the linker script.
extern std::uint32_t palpate_stack_top;

// Where the processor begins.
[[noreturn]] void reset_handler();
// Defined by the board.
[[noreturn]] void run_firmware();
}

namespace palpate::board {

using Handler = void (*)();
union Vector {
  Handler handler;
  const std::uint32_t* stack;
};
// Before those of the part's own interrupts.
inline constexpr std::uint32_t kSystemVectors = 16;

}  // namespace palpate::board
