// A build chooses by its include path what carries the link: here, FDCAN2, in the format of the framing.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "boards/nucleo_g474re/pins.hpp"
#include "boards/stm32g4/can_link.hpp"
#include "firmware/link/framing.hpp"

namespace palpate::board {

class BoardWire : public stm32g4::CanLink {
 public:
  BoardWire(firmware::LinkBuffers& link, const std::array<std::uint8_t, 16>&)
      : CanLink(link, std::is_same_v<firmware::LinkFraming, firmware::CanFdFraming>
                          ? wire::CanFormat::fd
                          : wire::CanFormat::classic) {}
  void begin() {
    stm32g4::set_alternate(kFdcanReceivePin.pin, kFdcanReceivePin.function, stm32g4::Pull::up);
    stm32g4::set_alternate(kFdcanTransmitPin.pin, kFdcanTransmitPin.function, stm32g4::Pull::none,
                           stm32g4::Speed::medium);
    CanLink::begin();
  }
};

}  // namespace palpate::board
