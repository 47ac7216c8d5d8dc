// A transfer as CAN frames. It is cut up piece by piece, so that no buffer need hold all of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/status.hpp"
#include "shared/wire/can_frame.hpp"
#include "shared/wire/can_record.hpp"
#include "shared/wire/crc.hpp"

namespace palpate::wire {

// Data of a transfer with this payload on the wire: payload, zeros up to a length that FD frames can have,
// and, in several frames, the CRC; tail bytes apart.
constexpr std::size_t can_content_bytes(std::size_t payload_bytes, CanFormat format) {
  const std::size_t most = can_mtu(format) - kCanTailBytes;
  const bool single = payload_bytes <= most;
  const std::size_t content_bytes = payload_bytes + (single ? 0 : kCanTransferCrcBytes);
  const std::size_t last = single ? content_bytes : content_bytes % most;  // 0: a full frame
  return content_bytes - last + can_padded_bytes(last + kCanTailBytes) - kCanTailBytes;
}
// Frames that it takes, and bytes of their records.
constexpr std::size_t can_transfer_frames(std::size_t payload_bytes, CanFormat format) {
  const std::size_t most = can_mtu(format) - kCanTailBytes;
  const std::size_t content_bytes = can_content_bytes(payload_bytes, format);
  return content_bytes == 0 ? 1 : (content_bytes + most - 1) / most;
}
constexpr std::size_t can_transfer_bytes(std::size_t payload_bytes, CanFormat format) {
  return can_content_bytes(payload_bytes, format) +
         can_transfer_frames(payload_bytes, format) * (kCanTailBytes + kCanRecordOverheadBytes);
}

// Any context, one owner. The cost is spread over the frames.
class CanSender {
 public:
  // Takes up a transfer, in place of what is left of the one before. `payload` must stay as it is until
  // done(). Status::not_for_can: header (see can_identifier); the sender is done then.
  Status begin(const FrameHeader& header, std::span<const std::uint8_t> payload, CanFormat format);
  [[nodiscard]] bool done() const { return done_; }
  // The next frame, only while not done(). Its data lie in the sender until the next call.
  CanFrame next();
  // Writes as many whole records as fit; returns their length. Call again with more room until done().
  std::size_t write(std::span<std::uint8_t> out);

 private:
  std::uint32_t identifier_ = 0;
  CanFormat format_ = CanFormat::classic;
  CanTail tail_{};
  std::span<const std::uint8_t> payload_{};
  std::size_t content_bytes_ = 0;
  std::size_t at_ = 0;  // of the content
  std::uint16_t crc_ = kCrc16Initial;
  bool single_ = false;
  bool done_ = true;
  std::array<std::uint8_t, 64> data_{};
};

}  // namespace palpate::wire
