// The link's bytes in the exchange as they are (EmulatedBoard).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.hpp"

namespace palpate::board {

class ByteWire {
 public:
  struct Hardware {};  // none

  ByteWire(firmware::LinkBuffers& link, Hardware&, const std::array<std::uint8_t, 16>&) : link_(link) {}

  void begin() {}
  // What does not fit is lost, as on a line whose receiver is too slow. Interrupt context.
  void isr_receive(std::span<const std::uint8_t> bytes) {
    const std::size_t length = std::min<std::size_t>(bytes.size(), link_.received.free());
    (void)link_.received.write(bytes.first(length));
  }
  // Returns how many bytes there were. Interrupt context.
  std::size_t isr_transmit(std::span<std::uint8_t> bytes) { return link_.transmit.read(bytes); }
  void poll_receive() {}
  void start_transmit() {}

 private:
  firmware::LinkBuffers& link_;
};

}  // namespace palpate::board
