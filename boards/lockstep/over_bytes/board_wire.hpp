// A build chooses by its include path what carries the link of an emulated board: here, the bytes as they
// are.
#pragma once

#include "boards/lockstep/byte_wire.hpp"

namespace palpate::board {
using BoardWire = ByteWire;
}  // namespace palpate::board
