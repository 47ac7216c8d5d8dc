// A build chooses by its include path what carries the link of an emulated board: here, a USB bus.
#pragma once

#include "boards/lockstep/usb_wire.hpp"

namespace palpate::board {
using BoardWire = UsbWire;
}  // namespace palpate::board
