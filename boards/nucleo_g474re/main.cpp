// The firmware on the NUCLEO-G474RE: interrupt handlers and main loop.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "boards/cortex_m/start_up.hpp"
#include "boards/nucleo_g474re/board.hpp"
#include "boards/stm32g4/core_registers.hpp"
#include "boards/stm32g4/fault_record.hpp"
#include "firmware/app/app.hpp"
#include "limits.hpp"
#include "shared/wire/node.hpp"

namespace palpate::board {

// What the image is, for programs that have it as a file.
struct ImageIdentity {
  std::uint64_t schema_hash = 0;
  std::array<char, 32> board{}, firmware{};
};

}  // namespace palpate::board

namespace {

using Board = palpate::board::NucleoG474re;
using App = palpate::firmware::App<Board>;

constexpr std::string_view kBoardName = PALPATE_BOARD_NAME;
static_assert(palpate::wire::is_node_name(kBoardName));

consteval std::array<char, 32> filled(std::string_view text) {
  std::array<char, 32> out{};
  std::ranges::copy(text, out.begin());
  return out;
}

// Set once before the interrupts come on.
App* app = nullptr;

// The chip's 96 bits, filled up with the part's name.
std::array<std::uint8_t, 16> unique_id() {
  std::array<std::uint8_t, 16> id{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 'G', '4', '7', '4'};
  const auto* const chip =
      reinterpret_cast<const volatile std::uint32_t*>(palpate::stm32g4::kUniqueId_address);
  for (std::size_t i = 0; i < 12; ++i) id[i] = static_cast<std::uint8_t>(chip[i / 4] >> (8 * (i % 4)));
  return id;
}

}  // namespace

extern "C" {

extern const palpate::board::ImageIdentity palpate_image_identity;
[[gnu::used, gnu::section(".identity")]] constinit const palpate::board::ImageIdentity palpate_image_identity{
    palpate::wire::kSchemaHash, filled(kBoardName), filled(PALPATE_VERSION)};

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
  stm32g4::SCB[stm32g4::scb::VTOR] = stm32g4::kFlash_address;
  stm32g4::note_reset();
  palpate_clock_source = Board::begin_pins_and_clock();
  // Not at namespace scope: built here, in RAM that start-up has zeroed, they cost no flash and no order of
  // construction.
  static const firmware::BoardIdentity identity{kBoardName, PALPATE_VERSION, unique_id()};
  static const stm32g4::CurrentCalibration calibration = board::stored_calibration();
  static Board the_board(calibration, identity.unique_id);
  static App the_app(the_board, identity, firmware::kCatchUpCortexM4, board::kLimits);
  app = &the_app;
  the_board.begin();
  the_board.start_ticks();
  for (;;) {
    if (the_app.background_due()) {
      the_app.background();
    } else {
      the_board.idle([] { return app->background_due(); });
    }
  }
}

}  // extern "C"
