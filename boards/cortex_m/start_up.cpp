// From reset to run_firmware(): FPU, data, constructors.
#include "boards/cortex_m/start_up.hpp"

extern "C" {
// Defined by the linker script.
extern std::uint32_t palpate_data_load, palpate_data_start, palpate_data_end;
extern std::uint32_t palpate_bss_start, palpate_bss_end;
using Constructor = void (*)();
extern Constructor palpate_init_array_start, palpate_init_array_end;

[[noreturn]] void start_up();

// The compiler may use floating-point registers anywhere, so the FPU comes on before the first compiled
// function.
[[gnu::naked]] void reset_handler() {
  asm volatile(
      "ldr r0, =0xE000ED88\n"  // CPACR
      "ldr r1, [r0]\n"
      "orr r1, r1, #(0xF << 20)\n"
      "str r1, [r0]\n"
      "dsb\n"
      "isb\n"
      "b start_up\n");
}

void start_up() {
  const std::uint32_t* source = &palpate_data_load;
  for (std::uint32_t* word = &palpate_data_start; word < &palpate_data_end;) *word++ = *source++;
  for (std::uint32_t* word = &palpate_bss_start; word < &palpate_bss_end;) *word++ = 0;
  for (Constructor* run = &palpate_init_array_start; run < &palpate_init_array_end; ++run) (*run)();
  run_firmware();
}

}  // extern "C"
