// The firmware as a Linux process: interrupt and background in turn, in one thread.
#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string_view>

#include "board_wire.hpp"
#include "boards/lockstep/emulated_board.hpp"
#include "boards/lockstep/start_times.hpp"
#include "boards/lockstep/unique_id.hpp"
#include "boards/native/limits.hpp"
#include "boards/native/platform.hpp"
#include "firmware/app/app.hpp"

namespace {

using palpate::board::BoardWire;
using palpate::board::NativePlatform;
using Board = palpate::board::EmulatedBoard<NativePlatform, BoardWire>;
using App = palpate::firmware::App<Board>;
using palpate::lockstep::ExitCode;

constexpr palpate::firmware::BoardIdentity kIdentity{PALPATE_BOARD_NAME, PALPATE_VERSION,
                                                     palpate::board::emulated_unique_id(PALPATE_BOARD_NAME)};
static_assert(palpate::wire::is_node_name(kIdentity.board));
constexpr const char* kUsage =
    "usage: palpate_native --lockstep ACTUATORS SENSORS [TIMES]\n"
    "                                                     in lock-step with a plant over two files (FIFOs);\n"
    "                                                     TIMES: see boards/lockstep/start_times.hpp\n"
    "       palpate_native --pty                          in real time, without a plant; prints the link's "
    "terminal\n"
    "       palpate_native --version                      says what it is\n";

// For the signal handler; set before it is installed.
Board* board = nullptr;

// The processor fault of this board. What runs here works on a broken process: it only writes to a
// descriptor.
extern "C" void handle_fault(int) {
  board->fail_safe();
  std::_Exit(static_cast<int>(ExitCode::processor_fault));
}

void install_fault_handler() {
  struct sigaction action {};
  action.sa_handler = handle_fault;
  for (const int fault : {SIGSEGV, SIGBUS, SIGILL, SIGFPE}) ::sigaction(fault, &action, nullptr);
  // A plant that has gone shows as a failed write.
  std::signal(SIGPIPE, SIG_IGN);
}

void run_in_lockstep(App& app) {
  for (;;) {  // the board exits the process
    app.isr_tick();
    app.background();
  }
}

void run_in_real_time(App& app, NativePlatform& platform) {
  for (;;) {
    platform.wait_for_tick();
    platform.receive(board->link());
    app.isr_tick();
    app.background();
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view mode = argc > 1 ? argv[1] : "";
  if (mode == "--version" && argc == 2) {
    std::printf("palpate %.*s %.*s schema %016" PRIx64 "\n", static_cast<int>(kIdentity.board.size()),
                kIdentity.board.data(), static_cast<int>(kIdentity.firmware.size()),
                kIdentity.firmware.data(), palpate::wire::kSchemaHash);
    return 0;
  }
  const bool lockstep = mode == "--lockstep" && (argc == 4 || argc == 5);
  if (!lockstep && !(mode == "--pty" && argc == 2)) {
    std::fputs(kUsage, stderr);
    return static_cast<int>(ExitCode::usage);
  }
  const char* const times = argc == 5 ? argv[4] : "";
  palpate::firmware::Limits limits = palpate::board::kLimits;
  if (argc == 5 && !palpate::board::take_start_times(times, limits)) {
    std::fprintf(stderr, "times of the supervisor out of range: \"%s\"\n", times);
    return static_cast<int>(ExitCode::usage);
  }
  NativePlatform platform =
      lockstep ? NativePlatform::in_lockstep(argv[2], argv[3], times) : NativePlatform::on_pseudo_terminal();
  const auto frames = std::make_unique<palpate::board::ExchangeFrames>();
  const auto hardware = std::make_unique<BoardWire::Hardware>();
  const auto the_board = std::make_unique<Board>(platform, *frames, *hardware, kIdentity.unique_id);
  the_board->begin();
  const auto app = std::make_unique<App>(*the_board, kIdentity, palpate::firmware::kCatchUpCortexM4, limits);
  board = the_board.get();
  install_fault_handler();
  if (lockstep) {
    run_in_lockstep(*app);
  } else {
    std::printf("%s\n", platform.terminal_path().c_str());
    std::fflush(stdout);
    run_in_real_time(*app, platform);
  }
  return 0;
}
