// Pins. Registers: AFRL or AFRH, OSPEEDR, PUPDR, then MODER. BSRR sets and clears outputs. The family
// switches the ports' clocks on.
#pragma once

#include "boards/stm32/registers.hpp"

namespace palpate::stm32 {

struct Pin {
  Base port;
  std::uint32_t number;
};
struct AlternatePin {
  Pin pin;
  std::uint32_t function;  // data sheet, alternate functions
};
enum class PinMode : std::uint32_t { input = 0, output = 1, alternate = 2, analog = 3 };
enum class Pull : std::uint32_t { none = 0, up = 1, down = 2 };
enum class Speed : std::uint32_t { low = 0, medium = 1, high = 2 };

inline void set_mode(Pin pin, PinMode mode, Pull pull = Pull::none) {
  const Bits two{2 * pin.number, 2};
  put(pin.port[gpio::PUPDR], two, static_cast<std::uint32_t>(pull));
  put(pin.port[gpio::MODER], two, static_cast<std::uint32_t>(mode));
}
inline void set_alternate(Pin pin, std::uint32_t function, Pull pull = Pull::none, Speed speed = Speed::low) {
  put(pin.port[pin.number < 8 ? gpio::AFRL : gpio::AFRH], Bits{4 * (pin.number % 8), 4}, function);
  put(pin.port[gpio::OSPEEDR], Bits{2 * pin.number, 2}, static_cast<std::uint32_t>(speed));
  set_mode(pin, PinMode::alternate, pull);
}
inline void set_alternate(const AlternatePin& one, Pull pull = Pull::none) {
  set_alternate(one.pin, one.function, pull);
}
inline void set_high(Pin pin) {
  pin.port[gpio::BSRR] = 1u << pin.number;
}
inline void set_low(Pin pin) {
  pin.port[gpio::BSRR] = 1u << (pin.number + 16);
}
inline bool is_high(Pin pin) {
  return is_set(pin.port[gpio::IDR], Bits{pin.number});
}

}  // namespace palpate::stm32
