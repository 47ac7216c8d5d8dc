// The wires of a USB bus inside an emulated board: records of usb_record.hpp on their way.
#pragma once

#include <cstdint>

#include "boards/lockstep/usb_record.hpp"
#include "firmware/ports/spsc_ring.hpp"

namespace palpate::lockstep {

// No memory of the firmware. Tokens of two ticks at least, and their answers.
struct UsbBus {
  firmware::SpscRing<std::uint8_t, 4096> to_board;
  firmware::SpscRing<std::uint8_t, 4096> from_board;
  // Ticks whose records found no room: the board was too long at something else. They are not answered.
  std::uint32_t ticks_lost = 0;  // interrupt's own
};

}  // namespace palpate::lockstep
