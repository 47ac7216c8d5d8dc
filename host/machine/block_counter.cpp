// Counts the instructions that Unicorn runs and stops it in time. Unicorn calls this before each block of
// code: from Python it would take longer than the code itself (palpate/machine/core.py loads it through
// ctypes).
#include <cstddef>
#include <cstdint>

namespace {

// Shared with Python: core.py has the same structure.
struct BlockCounter {
  std::uint64_t instructions;  // run so far, by whole blocks
  std::uint64_t limit;         // stops before the first block that begins at or above it
  std::uint32_t address;       // of the newest block
  std::uint32_t stopped;       // 1: stopped before that block
  const std::uint8_t* code;    // of the memory whose instructions are counted
  std::uint32_t base;          // its address
  std::uint32_t size;          // its bytes
  int (*stop)(void* unicorn);  // uc_emu_stop
};

// The upper five bits of a first halfword that a second one follows (Armv7-M manual, A5.1).
constexpr unsigned kWideInstruction = 0b11101;

}  // namespace

extern "C" void palpate_count_block(void* unicorn, std::uint64_t address, std::uint32_t bytes, void* user) {
  BlockCounter& counter = *static_cast<BlockCounter*>(user);
  counter.address = static_cast<std::uint32_t>(address);
  if (counter.instructions >= counter.limit) {
    counter.stopped = 1;
    counter.stop(unicorn);
    return;
  }
  if (address < counter.base || address + bytes > std::uint64_t{counter.base} + counter.size) {
    counter.instructions += bytes / 2;  // not in that memory: at most as many
    return;
  }
  const std::uint8_t* code = counter.code + (address - counter.base);
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < bytes; ++count) i += (code[i + 1] >> 3u) >= kWideInstruction ? 4 : 2;
  counter.instructions += count;
}
