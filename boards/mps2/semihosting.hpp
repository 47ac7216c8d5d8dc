// Arm semihosting: files of the machine that runs QEMU, opened, read and written by a breakpoint instruction.
// Source: Arm, "Semihosting for AArch32 and AArch64", release 3.0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace palpate::board::semihosting {

enum class Operation : std::uint32_t {
  open = 0x01,
  write = 0x05,
  read = 0x06,
  get_command_line = 0x15,
  exit_extended = 0x20,
};
enum class OpenMode : std::uint32_t { read_binary = 1, write_binary = 5 };
inline constexpr std::int32_t kNoHandle = -1;

inline std::uint32_t call(Operation operation, const void* block) {
  register std::uint32_t r0 asm("r0") = static_cast<std::uint32_t>(operation);
  register const void* r1 asm("r1") = block;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

inline std::uint32_t word(const void* pointer) {
  return reinterpret_cast<std::uint32_t>(pointer);
}

// `path` must end with a zero byte. Returns kNoHandle when the file cannot be opened. Opening a FIFO blocks
// until the other end is open.
inline std::int32_t open(const char* path, OpenMode mode) {
  const std::uint32_t block[3] = {word(path), static_cast<std::uint32_t>(mode),
                                  static_cast<std::uint32_t>(std::string_view(path).size())};
  return static_cast<std::int32_t>(call(Operation::open, block));
}

// Blocks until all bytes are read. False at the end of the file.
inline bool read_all(std::int32_t handle, std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const std::uint32_t block[3] = {static_cast<std::uint32_t>(handle), word(bytes.data()), bytes.size()};
    const std::uint32_t not_read = call(Operation::read, block);
    if (not_read >= bytes.size()) return false;
    bytes = bytes.last(not_read);
  }
  return true;
}

// False when the file takes no more.
inline bool write_all(std::int32_t handle, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const std::uint32_t block[3] = {static_cast<std::uint32_t>(handle), word(bytes.data()), bytes.size()};
    const std::uint32_t not_written = call(Operation::write, block);
    if (not_written >= bytes.size()) return false;
    bytes = bytes.last(not_written);
  }
  return true;
}

// The command line that QEMU was given for the program; empty when it does not fit in `buffer`.
inline std::string_view command_line(std::span<char> buffer) {
  std::uint32_t block[2] = {word(buffer.data()), buffer.size()};
  if (call(Operation::get_command_line, block) != 0) return {};
  return {buffer.data(), block[1]};
}

[[noreturn]] inline void exit(int code) {
  constexpr std::uint32_t kApplicationExit = 0x20026;
  const std::uint32_t block[2] = {kApplicationExit, static_cast<std::uint32_t>(code)};
  for (;;) call(Operation::exit_extended, block);
}

}  // namespace palpate::board::semihosting
