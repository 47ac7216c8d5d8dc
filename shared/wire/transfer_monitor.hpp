// Watches transfer identifiers: counts what was lost, and tells transfers that come again, or late, from new
// ones and from those of a peer that has started again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/wire/frame.hpp"

namespace palpate::wire {

// A transfer that comes again or late is one only within this time after the newest; later the peer has
// started again with a number of before (Cyphal's transfer-ID timeout, 2 s).
inline constexpr std::uint32_t kTransferIdTimeout_ticks = 2000;
// A larger step forward is a peer that started again, not this many losses.
inline constexpr std::uint64_t kLargestTransferGap = 65536;
// The newest transfers of a port, by number, of which it is known which came: one of them that comes now is
// late or comes again, an older one is of a peer that started again. On a link with more than one path (UDP)
// few overtake each other, and the shorter the window, the sooner a peer may start again.
inline constexpr unsigned kTransferWindow = 16;
// So many of them again in a row, each the one after the last and none new between them, are a peer that
// started again within its first ones.
inline constexpr unsigned kRestartRun = 4;
// Pairs of source and specifier that are told apart. When more are seen, the one that was silent longest is
// forgotten.
inline constexpr std::size_t kMonitoredPorts = 12;

enum class TransferKind : std::uint8_t {
  fresh,   // to be handled
  repeat,  // one again (a sender may send a service transfer twice): to be ignored
};

class TransferMonitor {
 public:
  // `id_bits` (1 to 64): what the medium carries of a transfer identifier; 64 on a serial link, 5 on CAN. Of
  // so few bits nothing tells a step back from a long one forward: there, where a port's transfers do not
  // overtake each other, every step is forward, of losses in a row what remains modulo 2^id_bits is counted,
  // and a peer that starts again seems to have lost up to 30.
  explicit constexpr TransferMonitor(unsigned id_bits = 64)
      : id_mask_(~std::uint64_t{0} >> (64u - id_bits)), window_(id_bits < 32 ? 1 : kTransferWindow) {}

  // Classifies a received frame and counts the transfers of its source and specifier that are missing before
  // it; one that comes late, by less than kTransferWindow, is fresh and no longer lost. A step back beyond
  // that is a peer that started again: fresh, nothing lost, and so on all of its ports, of which those with
  // few transfers could not tell. `now_tick` may wrap. Any context, one owner. At most 2 kMonitoredPorts
  // comparisons.
  TransferKind observe(const FrameHeader& header, std::uint32_t now_tick);
  // Missing until now; one that comes late is taken off again.
  [[nodiscard]] std::uint32_t lost() const { return lost_; }
  [[nodiscard]] std::uint32_t repeated() const { return repeated_; }
  [[nodiscard]] std::uint32_t late() const { return late_; }

 private:
  static_assert(kTransferWindow <= 16, "of Entry's bits");
  struct Entry {
    bool used = false;
    std::uint8_t again_run = 0, again_back = 0;  // so many in a row came again; the last of them
    std::uint16_t source = 0;
    std::uint16_t specifier = 0;
    // Of the newest kTransferWindow, bit k of the one k before the newest.
    std::uint16_t seen = 1;    // it came
    std::uint16_t missed = 0;  // it is counted as lost
    std::uint32_t last_tick = 0;
    std::uint64_t last_id = 0;
  };
  void advance(Entry& entry, std::uint64_t step);
  static bool begins_again(Entry& entry, unsigned back);
  void take_late(Entry& entry, unsigned back);
  void forget(std::uint16_t source);

  std::uint64_t id_mask_;
  unsigned window_;
  std::array<Entry, kMonitoredPorts> entries_{};
  std::uint32_t lost_ = 0;
  std::uint32_t repeated_ = 0;
  std::uint32_t late_ = 0;
};

}  // namespace palpate::wire
