// The last two pages of flash, for ParameterStore. They are in the second bank, and the image in the first,
// so that the processor goes on while a page is erased (22 ms): only with two banks, as the part is
// delivered.
//
// Registers: FLASH_OPTR (DBANK, BFB2); KEYR twice; SR, waits for BSY = 0, its flags cleared by 1; to erase
// CR.PER, PNB, BKER, then STRT; to program CR.PG, then two words; waits for BSY = 0; CR.LOCK; ACR.DCEN and
// DCRST, since the cache holds what was there. RM0440, 3.3. Eight bytes whose programming was cut off may be
// unreadable: reading them raises the NMI with FLASH_ECCR.ECCD, which nmi_handler() leaves to
// note_unreadable().
#pragma once

#include <cstdint>

#include "boards/stm32g4/registers.hpp"

namespace palpate::stm32g4 {

// Background context; no ticks are needed, and none are held up.
class ParameterFlash {
 public:
  static constexpr std::uint32_t kSlot_bytes = 2048;  // a page

  // Is the part set up for it?
  [[nodiscard]] static bool is_supported();

  bool erase(std::uint32_t slot);
  bool program(std::uint32_t slot, std::uint32_t offset, std::uint64_t value);
  bool read(std::uint32_t slot, std::uint32_t offset, std::uint64_t& value);

  // NMI: true if it came from read(), which then returns false.
  static bool note_unreadable();
};

}  // namespace palpate::stm32g4
