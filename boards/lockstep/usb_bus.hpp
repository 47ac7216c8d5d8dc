// A USB bus inside the lock-step exchange: what crosses between the board's virtual device controller
// (virtual_controller.hpp) and the far end, which is the host's controller, cable and all. The records take
// the place of the link's bytes in SensorFrame and ActuatorFrame.
//
// A record is kind, endpoint address (bit 7: to the host), length, and that many bytes. The far end's records
// of one tick are whole. Tokens (setup, out, in) are transactions of a full-speed bus and are answered one by
// one, in their order, in a later tick: with a handshake, with data, or with `silence` where a device would
// not answer at all. A tick is a frame of the bus (1 ms) and begins with `frame`. An endpoint that has
// refused data (nak) refuses all up to the next frame, so that packets which the far end has sent behind it
// keep their order; the far end sends them again, from the first that was refused on, once it has all
// answers.
//
// Data toggles are those of USB: a packet to the board that comes with the wrong one has come before, and is
// acknowledged and left out. Not modelled: addresses (there is one device), checks of packets (they arrive as
// they are), and acknowledgements of the host, which takes what it has asked for.
//
// A damaged record costs what is behind it in its tick: one `refused` comes in place of all those answers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/ports/spsc_ring.hpp"

namespace palpate::lockstep {

enum class UsbRecord : std::uint8_t {
  // To the board
  reset = 0x01,
  frame = 0x02,
  suspend = 0x03,
  resume = 0x04,
  unplug = 0x05,  // no voltage on the bus
  setup = 0x10,   // 8 bytes
  out_data0 = 0x11,
  out_data1 = 0x12,
  in = 0x13,
  // From the board
  attach = 0x81,  // pulls the bus up
  detach = 0x82,
  wake = 0x83,
  ack = 0x90,
  nak = 0x91,
  stall = 0x92,
  data0 = 0x93,
  data1 = 0x94,
  silence = 0x95,
  refused = 0x9F,
};

inline constexpr std::size_t kUsbHeaderBytes = 3;
inline constexpr std::size_t kUsbPacketBytes = 64;
inline constexpr std::size_t kUsbSetupBytes = 8;
inline constexpr std::size_t kUsbRecordBytes = kUsbHeaderBytes + kUsbPacketBytes;

// The wires: no memory of the firmware. Tokens of two ticks at least, and their answers.
struct UsbBus {
  firmware::SpscRing<std::uint8_t, 4096> to_board;
  firmware::SpscRing<std::uint8_t, 4096> from_board;
  // Ticks whose records found no room: the board was too long at something else. They are not answered.
  std::uint32_t ticks_lost = 0;  // interrupt's own
};

}  // namespace palpate::lockstep
