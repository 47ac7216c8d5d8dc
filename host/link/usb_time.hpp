// What a full-speed USB bus carries in a frame.
//
// USB 2.0 specification: full speed is 12 Mbit/s in frames of 1 ms, so 1,500 bytes a frame (8.4.3 and 5.3.3).
// A bulk transaction takes its data and 13 bytes (table 5-9: synchronization, packet identifiers, endpoint,
// CRC, pauses between packets), a data packet has at most 64 bytes, and none begins that would not end in its
// frame: at most 19 full packets a frame, 1,216 bytes. The frame itself begins with its start-of-frame
// packet. Stuff bits are left out, as in table 5-9; in random data they are 0.8 %.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::link {

inline constexpr std::size_t kUsbPacketBytes = 64;
inline constexpr std::uint64_t kUsbFrameBytes = 1500;
inline constexpr std::uint64_t kUsbTransactionOverheadBytes = 13;
// A token that the device refuses: of table 5-9's parts those of two packets of three, without data's CRC.
inline constexpr std::uint64_t kUsbRefusedInBytes = 8;
// Synchronization, identifier, frame number with CRC, end of packet: 35 bits (8.4.3, 7.1.13.2).
inline constexpr std::uint64_t kUsbStartOfFrameBytes = 5;
inline constexpr std::size_t kUsbPacketsPerFrame = 19;
static_assert(kUsbStartOfFrameBytes +
                  kUsbPacketsPerFrame * (kUsbPacketBytes + kUsbTransactionOverheadBytes) <=
              kUsbFrameBytes);
static_assert(kUsbStartOfFrameBytes +
                  (kUsbPacketsPerFrame + 1) * (kUsbPacketBytes + kUsbTransactionOverheadBytes) >
              kUsbFrameBytes);

}  // namespace palpate::link
