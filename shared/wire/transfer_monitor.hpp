// Watches transfer identifiers: counts what was lost, and tells repeated transfers from new ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/wire/frame.hpp"

namespace palpate::wire {

// A repeat of the last transfer is one only within this time; later the peer has started again with the same
// number (Cyphal's transfer-ID timeout, 2 s).
inline constexpr std::uint32_t kTransferIdTimeout_ticks = 2000;
// A larger step forward is a peer that started again, not this many losses.
inline constexpr std::uint64_t kLargestTransferGap = 65536;
// Pairs of source and specifier that are told apart. When more are seen, the one that was silent longest is
// forgotten.
inline constexpr std::size_t kMonitoredPorts = 12;

enum class TransferKind : std::uint8_t {
  fresh,   // to be handled
  repeat,  // the last one again (a sender may send a service transfer twice): to be ignored
};

class TransferMonitor {
 public:
  // `id_bits` (1 to 64): what the medium carries of a transfer identifier; 64 on a serial link, 5 on CAN. Of
  // losses in a row it can only count what remains modulo 2^id_bits, and a step back is none: a peer that
  // starts again on CAN seems to have lost up to 30.
  explicit constexpr TransferMonitor(unsigned id_bits = 64)
      : id_mask_(~std::uint64_t{0} >> (64u - id_bits)) {}

  // Classifies a received frame and counts the transfers of its source and specifier that are missing before
  // it. A step back by more than the last transfer is a peer that started again: fresh, nothing lost.
  // `now_tick` may wrap. Any context, one owner. At most kMonitoredPorts comparisons.
  TransferKind observe(const FrameHeader& header, std::uint32_t now_tick);
  [[nodiscard]] std::uint32_t lost() const { return lost_; }
  [[nodiscard]] std::uint32_t repeated() const { return repeated_; }

 private:
  struct Entry {
    bool used = false;
    std::uint16_t source = 0;
    std::uint16_t specifier = 0;
    std::uint32_t last_tick = 0;
    std::uint64_t last_id = 0;
  };
  std::uint64_t id_mask_;
  std::array<Entry, kMonitoredPorts> entries_{};
  std::uint32_t lost_ = 0;
  std::uint32_t repeated_ = 0;
};

}  // namespace palpate::wire
