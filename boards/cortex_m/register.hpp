// How registers are named and touched: a peripheral is a Base, RCC; a register an Offset, rcc::CR; a field of
// it Bits, rcc::CR_HSEON. RCC[rcc::CR] is the register.
//
// Names are those of the maker's SVD file, in capitals for that: so a test can hold every address, offset,
// field and interrupt number against it (host/python/tests/test_registers.py).
#pragma once

#include <concepts>
#include <cstdint>

namespace palpate::cortex_m {

struct Offset {
  std::uint32_t bytes;
};

using Register = volatile std::uint32_t;

// A constant, so that registers are there before anything is initialized.
struct Base {
  std::uintptr_t address;

  Register& operator[](Offset offset) const {
    return *reinterpret_cast<Register*>(address + offset.bytes);  // NOLINT: a register is at a fixed address
  }
};

// Field of a register: its lowest bit and how many there are.
struct Bits {
  std::uint32_t position;
  std::uint32_t width = 1;

  [[nodiscard]] constexpr std::uint32_t mask() const {
    return (width == 32 ? 0xFFFFFFFFu : (1u << width) - 1u) << position;
  }
  // The field with this value, which must fit, and zeros around it.
  [[nodiscard]] constexpr std::uint32_t of(std::uint32_t value) const { return value << position; }
};
constexpr std::uint32_t operator|(Bits left, Bits right) {
  return left.mask() | right.mask();
}
constexpr std::uint32_t operator|(std::uint32_t left, Bits right) {
  return left | right.mask();
}
constexpr std::uint32_t operator|(Bits left, std::uint32_t right) {
  return left.mask() | right;
}

inline void set(Register& one, std::uint32_t mask) {
  one = one | mask;
}
inline void set(Register& one, Bits bits) {
  set(one, bits.mask());
}
inline void clear(Register& one, std::uint32_t mask) {
  one = one & ~mask;
}
inline void clear(Register& one, Bits bits) {
  clear(one, bits.mask());
}
inline void put(Register& one, Bits bits, std::uint32_t value) {
  one = (one & ~bits.mask()) | bits.of(value);
}
// Clock of a peripheral: read back, for it takes two clocks until the peripheral answers (RM0440, 7.2.16;
// RM0090, 7.3.10).
inline void switch_on(Register& one, std::uint32_t mask) {
  set(one, mask);
  [[maybe_unused]] const std::uint32_t read_back = one;
}
inline void switch_on(Register& one, Bits bits) {
  switch_on(one, bits.mask());
}
[[nodiscard]] inline std::uint32_t get(const Register& one, Bits bits) {
  return (one & bits.mask()) >> bits.position;
}
[[nodiscard]] inline bool is_set(const Register& one, Bits bits) {
  return (one & bits.mask()) != 0;
}

// Looks at most kMostLooks times; false: it has not become so. A look takes four cycles at least, so that the
// wait is 6 ms at least at 170 MHz and 62 ms at 16 MHz: more than anything here may take that works. Start-up
// only: nothing waits for the hardware once ticks run, but where it says so.
inline constexpr std::uint32_t kMostLooks = 250'000;
template <class Condition>
[[nodiscard]] bool wait_until(Condition condition, std::uint32_t most_looks = kMostLooks) {
  for (std::uint32_t i = 0; i < most_looks; ++i) {
    if (condition()) return true;
  }
  return false;
}

// The same with a clock of its own.
template <class Condition, class TimeIsOver>
requires std::predicate<TimeIsOver>
[[nodiscard]] bool wait_until(Condition condition, TimeIsOver time_is_over) {
  while (!condition()) {
    if (time_is_over()) return condition();
  }
  return true;
}

}  // namespace palpate::cortex_m
