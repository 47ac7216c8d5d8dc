// What a transfer costs on a CAN bus, by computation: there is no bus in this project yet. Cyphal/CAN: 29-bit
// identifiers, a tail byte in each frame; a transfer that does not fit in one frame ends with a CRC of 2
// bytes.
//
// Frame lengths: ISO 11898-1:2015. A stuff bit follows at most every 4th bit of what is stuffed.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::link {

struct CanBus {
  bool fd = false;              // frames of up to 64 bytes, data at the data rate
  double nominal_bit_s = 1e-6;  // arbitration; everything on classic CAN
  double data_bit_s = 1e-6;
};
inline constexpr CanBus kClassicCan_1_Mbit{};
inline constexpr CanBus kCanFd_5_Mbit{.fd = true, .nominal_bit_s = 1e-6, .data_bit_s = 2e-7};

// Frames that a transfer of so many payload bytes takes.
std::size_t can_frames(const CanBus& bus, std::size_t payload_bytes);

// Longest time on the bus of a frame with so many data bytes (of CAN FD: one of its lengths), with all stuff
// bits that there may be, and the space before the next frame.
double can_frame_s(const CanBus& bus, std::size_t data_bytes);

// The same of a whole transfer.
double can_transfer_s(const CanBus& bus, std::size_t payload_bytes);

}  // namespace palpate::link
