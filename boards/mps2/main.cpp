// The firmware on QEMU's MPS2 boards: interrupt handlers, fault report and main loop.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "board_wire.hpp"
#include "boards/lockstep/emulated_board.hpp"
#include "boards/lockstep/unique_id.hpp"
#include "boards/mps2/console.hpp"
#include "boards/mps2/platform.hpp"
#include "boards/mps2/registers.hpp"
#include "firmware/app/app.hpp"
#include "limits.hpp"
#include "part.hpp"

namespace {

using palpate::board::BoardWire;
using palpate::board::print;
using palpate::board::print_hex;
using Board = palpate::board::EmulatedBoard<palpate::board::Mps2Platform, BoardWire>;
using App = palpate::firmware::App<Board>;

constexpr palpate::firmware::BoardIdentity kIdentity{PALPATE_BOARD_NAME, PALPATE_VERSION,
                                                     palpate::board::emulated_unique_id(PALPATE_BOARD_NAME)};
static_assert(palpate::wire::is_node_name(kIdentity.board));

[[gnu::section(".exchange")]] palpate::board::ExchangeFrames exchange_frames;
[[gnu::section(".exchange")]] BoardWire::Hardware wire_hardware;

// Bases, models in their slots, a waiting state and the tip's history: 109,448 bytes on both boards. The goal
// of 96 KiB is missed; what it would cost: docs/decisions/larger_part.md.
constexpr std::size_t kModelBufferBudget_bytes = 107 * 1024;
static_assert(sizeof(palpate::firmware::Renderer) <= kModelBufferBudget_bytes);

// Set once before the interrupts come on.
palpate::board::Mps2Platform* platform = nullptr;
Board* board = nullptr;
App* app = nullptr;

// What a processor fault leaves behind for the next boot.
struct FaultRecord {
  std::uint32_t magic;
  std::uint32_t program_counter;
  std::uint32_t status;
};
constexpr std::uint32_t kFaultRecordMagic = 0x46415554u;
[[gnu::section(".noinit")]] FaultRecord fault_record;

void print_banner() {
  constexpr auto kHash = palpate::wire::kSchemaHash;
  print("palpate ");
  print(kIdentity.board);
  print(" ");
  print(kIdentity.firmware);
  print(" schema ");
  print_hex(static_cast<std::uint32_t>(kHash >> 32));
  print_hex(static_cast<std::uint32_t>(kHash));
  print(platform->has_plant() ? " link lock-step\n" : " link uart1\n");
  if (fault_record.magic == kFaultRecordMagic) {
    print("restarted after a fault at ");
    print_hex(fault_record.program_counter);
    print(" status ");
    print_hex(fault_record.status);
    print("\n");
  }
  fault_record.magic = 0;
}

}  // namespace

extern "C" {

void timer0_handler() {
  palpate::board::timer0().interrupt_status = 1;
  app->isr_tick();
}

void uart1_receive_handler() {
  platform->isr_receive(board->link());
}

// Outputs off first, then the report. In lock-step the run ends here; with a line to the host the board
// starts again, with outputs off.
[[gnu::used]] void report_hard_fault(const std::uint32_t* stacked) {
  constexpr std::size_t kStackedProgramCounter = 6;
  if (board != nullptr) board->fail_safe();
  const palpate::board::FaultRegisters& registers = palpate::board::faults();
  fault_record = {kFaultRecordMagic, stacked[kStackedProgramCounter], registers.configurable_status};
  print("processor fault at ");
  print_hex(fault_record.program_counter);
  print(" CFSR ");
  print_hex(fault_record.status);
  print(" HFSR ");
  print_hex(registers.hard_status);
  print(" BFAR ");
  print_hex(registers.bus_address);
  print("\n");
  if (platform == nullptr || platform->has_plant()) {
    palpate::board::semihosting::exit(static_cast<int>(palpate::lockstep::ExitCode::processor_fault));
  }
  platform->reset();
}

// Also entered by interrupts that nobody asked for.
[[gnu::naked]] void hard_fault_handler() {
  asm volatile("mrs r0, msp\n b report_hard_fault\n");
}

// From start-up; a name of our own, for C++ forbids calling main().
[[noreturn]] void run_firmware() {
  // Not at namespace scope: built here, in RAM that start-up has zeroed, they cost no flash and no order of
  // construction.
  static palpate::board::Mps2Platform the_platform;
  palpate::board::console_begin();
  platform = &the_platform;
  static palpate::firmware::Limits limits = palpate::board::kLimits;
  the_platform.begin(limits);
  std::construct_at(&wire_hardware);  // start-up leaves this section as it is
  static Board the_board(the_platform, exchange_frames, wire_hardware, kIdentity.unique_id);
  static App the_app(the_board, kIdentity, palpate::board::kCatchUp, limits);
  board = &the_board;
  app = &the_app;
  the_board.begin();
  print_banner();
  the_platform.start_ticks();
  for (;;) {
    if (the_app.background_due()) {
      the_app.background();
    } else {
      the_platform.idle();
    }
  }
}

}  // extern "C"
