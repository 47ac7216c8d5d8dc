// From reset to run_firmware(): vector table, FPU, data, constructors.
#include <array>
#include <cstddef>
#include <cstdint>

extern "C" {
// Defined by the linker script.
extern std::uint32_t palpate_stack_top;
extern std::uint32_t palpate_data_load, palpate_data_start, palpate_data_end;
extern std::uint32_t palpate_bss_start, palpate_bss_end;
using Constructor = void (*)();
extern Constructor palpate_init_array_start, palpate_init_array_end;

// Defined in main.cpp.
[[noreturn]] void run_firmware();
void hard_fault_handler();
void timer0_handler();
void uart1_receive_handler();

[[noreturn]] void reset_handler();
[[noreturn]] void start_up();
}

namespace {

// An interrupt that nobody asked for: the fault handler reports it.
[[gnu::naked]] void unexpected_handler() {
  asm volatile("b hard_fault_handler");
}

using Handler = void (*)();
union Vector {
  Handler handler;
  const std::uint32_t* stack;
};
constexpr std::size_t kSystemVectors = 16;
constexpr std::size_t kInterrupts = 32;

constexpr std::array<Vector, kSystemVectors + kInterrupts> make_vectors() {
  std::array<Vector, kSystemVectors + kInterrupts> table{};
  for (Vector& vector : table) vector.handler = unexpected_handler;
  table[0].stack = &palpate_stack_top;
  table[1].handler = reset_handler;
  table[3].handler =
      hard_fault_handler;  // MemManage, BusFault and UsageFault stay disabled and escalate to it
  table[kSystemVectors + 2].handler = uart1_receive_handler;
  table[kSystemVectors + 8].handler = timer0_handler;
  return table;
}
[[gnu::section(".vectors"), gnu::used]] constexpr auto kVectors = make_vectors();

}  // namespace

extern "C" {

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
