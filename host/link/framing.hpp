// How transfers become bytes of a link, and bytes transfers: Cyphal/serial, or Cyphal/CAN as a stream of CAN
// records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "shared/wire/reception.hpp"

namespace palpate::link {

enum class FramingKind : std::uint8_t { serial, can_classic, can_fd };

// Longest payload taken from the peer; the present messages have at most wire::kLargestPayloadToHost and
// wire::kLargestPayloadToBoard.
inline constexpr std::size_t kReceiverCapacity = 8192;

// One thread.
class Framing {
 public:
  virtual ~Framing() = default;
  Framing(const Framing&) = delete;
  Framing& operator=(const Framing&) = delete;

  // One whole transfer. Throws std::invalid_argument for a header that the framing cannot carry: on CAN nodes
  // beyond 127, subjects beyond 8191, services beyond 511.
  [[nodiscard]] virtual std::vector<std::uint8_t> encode(const wire::FrameHeader& header,
                                                         std::span<const std::uint8_t> payload) const = 0;
  // Takes bytes up to the end of the next whole transfer, or all of them; call again with the rest until
  // nothing is complete. The transfer is valid until the next call. `tick`: now.
  virtual wire::Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t tick) = 0;
  [[nodiscard]] virtual const wire::ReceiverCounters& counters() const = 0;
  // What a received header has of the sender's transfer identifier.
  [[nodiscard]] virtual unsigned transfer_id_bits() const = 0;

 protected:
  Framing() = default;
};

std::unique_ptr<Framing> make_framing(FramingKind kind);

}  // namespace palpate::link
