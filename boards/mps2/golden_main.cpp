// The golden trace (shared/golden) on QEMU's MPS2 boards: prints its hashes on UART0 as
// shared/golden/main.cpp does, and ends QEMU.
#include <cstdint>
#include <string_view>

#include "boards/mps2/console.hpp"
#include "boards/mps2/semihosting.hpp"
#include "shared/golden/golden_trace.hpp"

namespace {

palpate::golden::GoldenTrace trace;

void print_line(std::string_view name, std::uint64_t hash) {
  palpate::board::print(name);
  palpate::board::print_hex(static_cast<std::uint32_t>(hash >> 32));
  palpate::board::print_hex(static_cast<std::uint32_t>(hash));
  palpate::board::print("\n");
}

}  // namespace

extern "C" {

[[noreturn]] void run_firmware() {
  palpate::board::console_begin();
  const palpate::golden::Result result = trace.run();
  print_line("model ", result.model_hash);
  print_line("near ", result.near_hash);
  print_line("felt ", result.felt_hash);
  print_line("device ", result.device_hash);
  print_line("math ", result.math_hash);
  print_line("work ", result.work);
  palpate::board::semihosting::exit(0);
}

}  // extern "C"
