// The firmware on the Adafruit Feather STM32F405: interrupt handler and main loop.
#include "board.hpp"
#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/main_loop.hpp"
#include "boards/cortex_m/start_up.hpp"
#include "boards/stm32/unique_id.hpp"
#include "firmware/app/app.hpp"

namespace {

using Board = palpate::board::FeatherStm32f405;
using App = palpate::firmware::App<Board>;

// Set once before the interrupts come on.
App* app = nullptr;

}  // namespace

extern "C" {

// What start_clock() found.
[[gnu::used]] palpate::stm32f4::ClockSource palpate_clock_source;

void tim7_handler() {
  palpate::stm32f4::Timebase::acknowledge();
  app->isr_tick();
}

// Without limits of its own: a skeleton has the default ones, and nothing that they limit.
[[noreturn]] void run_firmware() {
  namespace cortex_m = palpate::cortex_m;
  namespace firmware = palpate::firmware;
  namespace stm32f4 = palpate::stm32f4;
  cortex_m::SCB[cortex_m::scb::VTOR] = stm32f4::kFlash_address;
  cortex_m::note_reset(stm32f4::reset_causes());
  palpate_clock_source = Board::begin_pins_and_clock();
  // Built here, in RAM that start-up has zeroed.
  static const firmware::BoardIdentity identity{PALPATE_BOARD_NAME, PALPATE_VERSION,
                                                stm32f4::unique_id(stm32f4::kUniqueId_address, "F405")};
  static Board the_board;
  static App the_app(the_board, identity, firmware::kCatchUpCortexM4);
  app = &the_app;
  the_board.begin();
  the_board.start_ticks();
  cortex_m::run_background(the_app, the_board);
}

}  // extern "C"
