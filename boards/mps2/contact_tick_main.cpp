// Measures the contact tick on a QEMU MPS2 board (shared/bench, host/bench/contact_tick.py): the command line
// is the number of situations of each size and surface; prints a line "size surface tick kind counts" for
// each tick on UART0, counts of the 25 MHz clock in hexadecimal, and ends QEMU.
#include <array>
#include <cstdint>
#include <string_view>

#include "boards/mps2/console.hpp"
#include "boards/mps2/registers.hpp"
#include "boards/mps2/semihosting.hpp"
#include "shared/bench/contact_situations.hpp"

namespace {

using palpate::bench::ContactSituations;
using palpate::bench::ModelSize;

// Nothing of a situation is known in the first; the second follows it.
constexpr std::uint32_t kTicksPerSituation = 2;

ContactSituations situations;

// Digits up to the first other character.
std::uint32_t to_number(std::string_view text) {
  std::uint32_t number = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') break;
    number = 10u * number + static_cast<std::uint32_t>(c - '0');
  }
  return number;
}

void print_digit(std::uint32_t digit) {
  const char text[2] = {static_cast<char>('0' + digit), ' '};
  palpate::board::print(std::string_view(text, 2));
}

std::uint32_t clock_count() {
  return ~palpate::board::timer1().value;
}

void measure(ModelSize size, palpate::SurfaceKind surface, std::uint32_t count) {
  for (std::uint32_t number = 0; number < count; ++number) {
    situations.prepare(size, surface, number);
    for (std::uint32_t tick = 0; tick < kTicksPerSituation; ++tick) {
      const std::uint32_t start = clock_count();
      situations.step();
      const std::uint32_t counts = clock_count() - start;
      print_digit(static_cast<std::uint32_t>(size));
      print_digit(static_cast<std::uint32_t>(surface));
      print_digit(tick);
      print_digit(static_cast<std::uint32_t>(situations.finish()));
      palpate::board::print_hex(counts);
      palpate::board::print("\n");
    }
  }
}

}  // namespace

extern "C" {

[[noreturn]] void run_firmware() {
  palpate::board::console_begin();
  palpate::board::timer1().reload = UINT32_MAX;
  palpate::board::timer1().value = UINT32_MAX;
  palpate::board::timer1().control = palpate::board::kTimerEnable;
  std::array<char, 16> buffer{};
  const std::uint32_t count = to_number(palpate::board::semihosting::command_line(buffer));
  for (const ModelSize size :
       {ModelSize::modes_96_nodes_32, ModelSize::modes_192_nodes_16, ModelSize::near_field})
    for (const palpate::SurfaceKind surface : palpate::bench::kSurfaces) measure(size, surface, count);
  palpate::board::semihosting::exit(0);
}

}  // extern "C"
