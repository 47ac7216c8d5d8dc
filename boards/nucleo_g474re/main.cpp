// The firmware on the NUCLEO-G474RE: interrupt handlers and main loop.
#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/cortex_m/main_loop.hpp"
#include "boards/cortex_m/start_up.hpp"
#include "boards/nucleo_g474re/board.hpp"
#include "boards/stm32/unique_id.hpp"
#include "firmware/app/app.hpp"
#include "limits.hpp"

namespace {

using Board = palpate::board::NucleoG474re;
using App = palpate::firmware::App<Board>;

// Set once before the interrupts come on.
App* app = nullptr;

}  // namespace

extern "C" {

// What start_clock() found.
[[gnu::used]] palpate::stm32g4::ClockSource palpate_clock_source;

void tim7_handler() {
  palpate::stm32g4::Timebase::acknowledge();
  app->isr_tick();
}

[[noreturn]] void run_firmware() {
  namespace board = palpate::board;
  namespace firmware = palpate::firmware;
  namespace stm32g4 = palpate::stm32g4;
  namespace cortex_m = palpate::cortex_m;
  cortex_m::SCB[cortex_m::scb::VTOR] = stm32g4::kFlash_address;
  cortex_m::note_reset(stm32g4::reset_causes());
  palpate_clock_source = Board::begin_pins_and_clock();
  // Not at namespace scope: built here, in RAM that start-up has zeroed, they cost no flash and no order of
  // construction.
  static const firmware::BoardIdentity identity{PALPATE_BOARD_NAME, PALPATE_VERSION,
                                                stm32g4::unique_id(stm32g4::kUniqueId_address, "G474")};
  static Board the_board(identity.unique_id);
  static App the_app(the_board, identity, firmware::kCatchUpCortexM4, board::kLimits);
  app = &the_app;
  the_board.begin();
  the_board.start_ticks();
  cortex_m::run_background(the_app, the_board);
}

}  // extern "C"
