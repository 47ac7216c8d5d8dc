// Vector table.
#include "boards/cortex_m/vectors.hpp"

#include "boards/stm32f4/registers.hpp"

extern "C" {
// Defined by the board.
void tim7_handler();
}

namespace palpate::stm32f4 {
namespace {

[[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors =
    vectors<kInterrupts>({{interrupt::TIM7, tim7_handler}});

}  // namespace
}  // namespace palpate::stm32f4
