// Bytes in, good frames out. A fault costs the frame that it hits and is counted; the next delimiter starts
// afresh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/wire/cobs.hpp"
#include "shared/wire/crc.hpp"
#include "shared/wire/frame.hpp"
#include "shared/wire/reception.hpp"

namespace palpate::wire {

// Decodes into a buffer that it is given, which bounds header, payload and CRC together. Use FrameReceiver.
class FrameDecoder {
 public:
  explicit FrameDecoder(std::span<std::uint8_t> buffer) : buffer_(buffer) {}
  FrameDecoder(const FrameDecoder&) = delete;
  FrameDecoder& operator=(const FrameDecoder&) = delete;

  // Takes bytes up to the end of the next good frame, or all of them. Call again with the rest until it is
  // empty. The work is spread over the bytes: a frame's last byte costs no more than the others and one
  // header check. Any context, one owner. Cost on a Cortex-M4F: docs/protocol.md.
  Reception receive(std::span<const std::uint8_t> bytes);
  [[nodiscard]] const ReceiverCounters& counters() const { return counters_; }

 private:
  Status finish(Frame& frame) const;

  std::span<std::uint8_t> buffer_;
  CobsDecoder cobs_{};
  std::size_t length_ = 0;  // bytes decoded of the frame at hand
  std::uint32_t crc_ = kCrc32cInitial;
  bool skipping_ = false;  // the frame at hand was refused: wait for its delimiter
  ReceiverCounters counters_{};
};

// A FrameDecoder with its buffer, for payloads of up to `Capacity` bytes.
template <std::size_t Capacity>
class FrameReceiver {
 public:
  Reception receive(std::span<const std::uint8_t> bytes) { return decoder_.receive(bytes); }
  [[nodiscard]] const ReceiverCounters& counters() const { return decoder_.counters(); }

 private:
  alignas(8) std::array<std::uint8_t, Capacity + kFrameOverheadBytes> buffer_{};
  FrameDecoder decoder_{buffer_};
};

}  // namespace palpate::wire
