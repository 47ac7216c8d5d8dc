// Consistent Overhead Byte Stuffing (Cheshire and Baker, IEEE/ACM Trans. Networking 7(2), 1999): packets
// without the byte 0, so that 0 can delimit them. At most one byte of overhead for each 254 bytes begun.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::wire {

inline constexpr std::uint8_t kCobsDelimiter = 0;
inline constexpr std::size_t kCobsRun = 254;  // longest run without a zero that one code byte covers

// Largest encoding of `bytes` bytes, without delimiters.
constexpr std::size_t cobs_max_bytes(std::size_t bytes) {
  return bytes + bytes / kCobsRun + 1;
}

// Encodes one packet, given in pieces, into a bounded span. Writes no delimiters. Any context, one owner.
class CobsEncoder {
 public:
  explicit CobsEncoder(std::span<std::uint8_t> out) : out_(out) {}
  // Appends a piece of the packet. Once a byte does not fit the rest is dropped, and finish() reports it.
  void put(std::span<const std::uint8_t> bytes);
  // Ends the packet. Returns the length of its encoding; 0: `out` was too small. Call once.
  std::size_t finish();

 private:
  std::span<std::uint8_t> out_;
  std::size_t code_at_ = 0;  // where the open block's code byte belongs; it is written when the block ends
  std::size_t length_ = 1;  // of the encoding, the open block's code byte included, which may lie beyond out_
  bool after_full_block_ = false;
  bool overflow_ = false;
};

// Decodes a stream in runs of any length, up to the next delimiter. Any context, one owner.
class CobsDecoder {
 public:
  enum class Stop : std::uint8_t {
    input_end,    // all of `in` was decoded
    delimiter,    // the delimiter that ends the packet was consumed
    output_full,  // the next byte of the packet has no room in `out`
  };
  struct Step {
    std::size_t consumed = 0;  // bytes taken from the front of `in`
    std::size_t written = 0;   // bytes put into the front of `out`
    Stop stop = Stop::input_end;
  };
  Step decode(std::span<const std::uint8_t> in, std::span<std::uint8_t> out);
  // After Stop::delimiter. empty(): nothing stood before the delimiter. whole(): the packet ended where a
  // block did; otherwise it was cut, or it is no COBS encoding.
  [[nodiscard]] bool empty() const { return !started_; }
  [[nodiscard]] bool whole() const { return left_ == 0; }
  // Starts the next packet.
  void reset() { *this = CobsDecoder{}; }

 private:
  std::size_t left_ = 0;   // bytes missing from the open block
  bool zero_due_ = false;  // a zero stands before the next block, if there is one
  bool started_ = false;
};

}  // namespace palpate::wire
