#pragma once

namespace palpate::board {

// Defined by the board: outputs off, by registers only. Any context, at any time after the pins are set up.
void fail_safe();

}  // namespace palpate::board
