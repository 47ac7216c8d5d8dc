// Text for people on UART0.
#pragma once

#include <cstdint>
#include <string_view>

#include "boards/mps2/registers.hpp"

namespace palpate::board {

inline void console_begin() {
  uart0().baud_divider = 16;  // the smallest that the UART accepts: QEMU's line has no speed
  uart0().control = kUartTransmitEnable;
}

inline void print(std::string_view text) {
  for (const char c : text) {
    while ((uart0().state & kUartTransmitFull) != 0) {
    }
    uart0().data = static_cast<std::uint8_t>(c);
  }
}

inline void print_hex(std::uint32_t value) {
  for (int shift = 28; shift >= 0; shift -= 4) {
    print(std::string_view("0123456789abcdef").substr((value >> shift) & 15u, 1));
  }
}

}  // namespace palpate::board
