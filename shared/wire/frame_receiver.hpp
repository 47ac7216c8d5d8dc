// Bytes in, good frames out. A fault costs the frame that it hits and is counted; the next delimiter starts
// afresh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shared/status.hpp"
#include "shared/wire/cobs.hpp"
#include "shared/wire/crc.hpp"
#include "shared/wire/frame.hpp"

namespace palpate::wire {

// What a receiver has seen since it was made.
struct ReceiverCounters {
  std::uint32_t frames = 0;  // delivered
  // By the fault's Status value, frame_too_long to not_a_single_frame; entry 0 stays 0.
  std::array<std::uint32_t, static_cast<std::size_t>(Status::not_a_single_frame) + 1> faults{};
  Status last_fault = Status::ok;

  [[nodiscard]] std::uint32_t of(Status fault) const { return faults[static_cast<std::size_t>(fault)]; }
  [[nodiscard]] std::uint32_t refused() const {
    std::uint32_t sum = 0;
    for (const std::uint32_t count : faults) sum += count;
    return sum;
  }
};

struct Reception {
  std::size_t consumed = 0;  // bytes taken from the front of the input
  bool complete = false;     // `frame` holds a frame; valid until the next call of receive()
  Frame frame{};
};

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
  void refuse(Status fault);
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
