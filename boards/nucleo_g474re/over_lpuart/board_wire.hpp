// A build chooses by its include path what carries the link: here, LPUART1 to the ST-LINK's virtual serial
// port.
#pragma once

#include <array>
#include <cstdint>

#include "boards/nucleo_g474re/pins.hpp"
#include "boards/stm32g4/lpuart_link.hpp"

namespace palpate::board {

class BoardWire : public stm32g4::LpuartLink {
 public:
  BoardWire(firmware::LinkBuffers& link, const std::array<std::uint8_t, 16>&) : LpuartLink(link) {}
  void begin() {
    stm32g4::set_alternate(kLpuartTransmitPin.pin, kLpuartTransmitPin.function);
    stm32g4::set_alternate(kLpuartReceivePin.pin, kLpuartReceivePin.function, stm32g4::Pull::up);
    LpuartLink::begin();
  }
};

}  // namespace palpate::board
