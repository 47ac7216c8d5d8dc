// How the board puts transfers on its link and takes them from it: a choice of the build, with an image for
// each (boards/CMakeLists.txt). What the framings have in common:
//   kTransferIdBits  of a transfer identifier, that the link carries
//   kLargestSent     bytes on the link of the largest transfer to the host
//   receive()        takes bytes up to the end of the next good transfer, or all of them; call again with the
//                    rest until nothing is complete
//   send()           writes a transfer to the transmit ring; false, and nothing written: it does not fit
// Background context; one owner.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.hpp"
#include "shared/wire/can_receiver.hpp"
#include "shared/wire/can_sender.hpp"
#include "shared/wire/frame_receiver.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/registers.hpp"

namespace palpate::firmware {

using TransmitRing = decltype(LinkBuffers::transmit);

// Cyphal/serial.
class SerialFraming {
 public:
  static constexpr unsigned kTransferIdBits = 64;
  static constexpr std::size_t kLargestSent = wire::max_frame_bytes(wire::kLargestPayloadToHost);

  wire::Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t) {
    return receiver_.receive(bytes);
  }
  [[nodiscard]] const wire::ReceiverCounters& counters() const { return receiver_.counters(); }
  bool send(const wire::FrameHeader& header, std::span<const std::uint8_t> payload, TransmitRing& ring) {
    const std::size_t length = wire::encode_frame(header, payload, frame_);
    return length != 0 && ring.write(std::span(frame_).first(length));
  }

 private:
  wire::FrameReceiver<wire::kLargestPayloadToBoard> receiver_;
  std::array<std::uint8_t, kLargestSent> frame_{};  // too large for the stack
};

template <class Message>
constexpr wire::CanRoom room_for() {
  return {.capacity = wire::MessageTraits<Message>::kMaxBytes,
          .specifier = wire::MessageTraits<Message>::kSpecifier};
}

// Cyphal/CAN as records.
template <wire::CanFormat Format>
class CanFraming {
 public:
  static constexpr unsigned kTransferIdBits = wire::kCanTransferIdBits;
  static constexpr std::size_t kLargestSent = wire::can_transfer_bytes(wire::kLargestPayloadToHost, Format);

  wire::Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t now_tick) {
    return receiver_.receive(bytes, now_tick);
  }
  [[nodiscard]] const wire::ReceiverCounters& counters() const { return receiver_.counters(); }
  bool send(const wire::FrameHeader& header, std::span<const std::uint8_t> payload, TransmitRing& ring) {
    if (ring.free() < wire::can_transfer_bytes(payload.size(), Format)) return false;
    if (sender_.begin(header, payload, Format) != Status::ok) return false;
    std::array<std::uint8_t, wire::kMaxCanRecordBytes> records;
    while (!sender_.done()) {
      const std::size_t length = sender_.write(records);
      if (!ring.write(std::span(records).first(length))) return false;  // not reached: there was room
    }
    return true;
  }

 private:
  // All that the host sends and that does not fit in one frame of classic CAN, 7 bytes; on CAN FD the small
  // ones do. A message that is missing here never arrives.
  static constexpr std::array<wire::CanRoom, 6> kRooms{
      room_for<palpate_ModelState_1_0>(),   room_for<palpate_ModelPart_1_0>(),
      room_for<palpate_TraceRequest_1_0>(), room_for<palpate_Command_Request_1_0>(),
      room_for<palpate_DirectForce_1_0>(),  room_for<wire::RegisterAccessRequest>()};
  static_assert(wire::MessageTraits<palpate_GetInfo_Request_1_0>::kMaxBytes <= 7);
  static_assert(wire::MessageTraits<wire::RegisterListRequest>::kMaxBytes <= 7);

  wire::CanRoomsReceiver<kRooms> receiver_{wire::kBoardNode};
  wire::CanSender sender_;
};
using ClassicCanFraming = CanFraming<wire::CanFormat::classic>;
using CanFdFraming = CanFraming<wire::CanFormat::fd>;

#ifndef PALPATE_LINK_FRAMING
#define PALPATE_LINK_FRAMING SerialFraming
#endif
using LinkFraming = PALPATE_LINK_FRAMING;

}  // namespace palpate::firmware
