// What crosses in the lock-step exchange where the link is a USB bus, between the board's device controller
// (virtual_controller.hpp, or the register model of a real part's) and the far end, which is the host's
// controller, cable and all. The records take the place of the link's bytes in SensorFrame and ActuatorFrame.
//
// A record is kind, endpoint address (bit 7: to the host), length, and that many bytes. The far end's records
// of one tick are whole. Tokens (setup, out, in) are transactions of a full-speed bus and are answered one by
// one, in their order, in a later tick: with a handshake, with data, or with `silence` where a device would
// not answer at all. A tick is a frame of the bus (1 ms) and begins with `frame`.
//
// The far end need not wait for an answer before its next token: an endpoint that has refused data (nak)
// refuses all that comes behind, so that packets keep their order, up to a packet with kUsbAgain: with that
// one the far end, which has all answers by then, begins again with the first that was refused.
//
// Data toggles are those of USB: a packet to the board that comes with the wrong one has come before, and is
// acknowledged and left out. A packet from the board that was asked for with kUsbUnheard is not acknowledged
// by the host: the board keeps it, and its toggle, for the next token. A damaged packet to the board is one
// that does not cross. Not modelled: addresses (there is one device).
//
// A damaged record costs what is behind it in its tick: one `refused` comes in place of all those answers.
#pragma once

#include <cstddef>
#include <cstdint>

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

// In the address of a packet to the board, and of a token for one from it.
inline constexpr std::uint8_t kUsbAgain = 0x40, kUsbUnheard = 0x40;

inline constexpr std::size_t kUsbHeaderBytes = 3;
inline constexpr std::size_t kUsbPacketBytes = 64;
inline constexpr std::size_t kUsbSetupBytes = 8;
inline constexpr std::size_t kUsbRecordBytes = kUsbHeaderBytes + kUsbPacketBytes;

}  // namespace palpate::lockstep
