#include "host/link/can_cost.hpp"

#include <algorithm>

namespace palpate::link {
namespace {

constexpr std::size_t kTransferCrcBytes = 2;

std::size_t payload_of_frame(const CanBus& bus) {
  return bus.fd ? 63 : 7;  // less the tail byte
}

// Data lengths of CAN FD frames.
std::size_t padded(std::size_t data_bytes) {
  for (const std::size_t length : {8u, 12u, 16u, 20u, 24u, 32u, 48u})
    if (data_bytes <= length) return data_bytes <= 8 ? data_bytes : length;
  return 64;
}

}  // namespace

std::size_t can_frames(const CanBus& bus, std::size_t payload_bytes) {
  const std::size_t most = payload_of_frame(bus);
  if (payload_bytes <= most) return 1;
  return (payload_bytes + kTransferCrcBytes + most - 1) / most;
}

double can_frame_s(const CanBus& bus, std::size_t data_bytes) {
  const auto data_bits = static_cast<double>(8 * data_bytes);
  const auto stuffed = [](double bits) {
    return bits + static_cast<double>(static_cast<int>((bits - 1.0) / 4.0));
  };
  // CRC delimiter, acknowledgement and its delimiter, end of frame, intermission: not stuffed.
  constexpr double kEndBits = 1 + 2 + 7 + 3;
  if (!bus.fd) {
    // Start, identifier 11 + 18, SRR, IDE, RTR, two reserved, length 4, data, CRC 15.
    constexpr double kHeadBits = 1 + 29 + 3 + 2 + 4;
    return (stuffed(kHeadBits + data_bits + 15) + kEndBits) * bus.nominal_bit_s;
  }
  // Start, identifier, SRR, IDE, RRS, FDF, reserved, BRS at the nominal rate; ESI, length 4, data at the data
  // rate; then count of stuff bits 4 and CRC 17 or 21 with a stuff bit before every 4 bits.
  constexpr double kArbitrationBits = 1 + 29 + 6;
  const double crc_bits = data_bytes > 16 ? 21.0 : 17.0;
  const double fixed_stuff_bits = data_bytes > 16 ? 7.0 : 6.0;
  const double data_phase_bits = stuffed(5 + data_bits) + 1 + 4 + crc_bits + fixed_stuff_bits;
  return (stuffed(kArbitrationBits) + kEndBits) * bus.nominal_bit_s + data_phase_bits * bus.data_bit_s;
}

double can_transfer_s(const CanBus& bus, std::size_t payload_bytes) {
  const std::size_t most = payload_of_frame(bus), frames = can_frames(bus, payload_bytes);
  const std::size_t all_bytes = payload_bytes + (frames > 1 ? kTransferCrcBytes : 0);
  const std::size_t last_bytes = all_bytes - (frames - 1) * most + 1;
  return static_cast<double>(frames - 1) * can_frame_s(bus, most + 1) +
         can_frame_s(bus, bus.fd ? padded(last_bytes) : last_bytes);
}

}  // namespace palpate::link
