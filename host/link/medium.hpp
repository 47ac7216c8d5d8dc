// One direction of the link between host and board, metered in virtual time: what was submitted arrives when
// the medium that it stands for would have brought it. A full-duplex link is two of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::link {

inline constexpr std::uint32_t kTicksPerSecond = 1000;

struct MediumCounters {
  std::uint64_t bytes_accepted = 0;
  std::uint64_t bytes_delivered = 0;
  std::uint64_t bytes_dropped = 0;        // of the submissions below
  std::uint64_t submissions_dropped = 0;  // they did not fit in the queue
  // Of a CAN bus: frames that an error hit, which were sent again, and times that the sender was off the bus.
  std::uint64_t attempts_failed = 0, bus_offs = 0;
  double busy_ticks = 0.0;  // time for which the medium carried what it has delivered, overhead included
};

// Tick k is the instant at which servo tick k begins. The ticks given to one medium never decrease; otherwise
// std::invalid_argument. One thread.
class Medium {
 public:
  virtual ~Medium() = default;
  Medium(const Medium&) = delete;
  Medium& operator=(const Medium&) = delete;

  // Hands bytes to the sender at the start of `tick`; they queue behind earlier ones. A submission that does
  // not fit in the queue is dropped whole and counted (returns false): submit whole frames, so that whole
  // frames are lost.
  virtual bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) = 0;
  // Takes the bytes that have fully arrived by the start of `tick`, in the order of submission.
  virtual std::vector<std::uint8_t> deliver(std::uint32_t tick) = 0;
  // Bytes submitted that have not fully arrived by the start of `tick`: a sender that looks here need lose
  // nothing.
  [[nodiscard]] virtual std::size_t backlog_bytes(std::uint32_t tick) const = 0;
  // What it carries at most.
  [[nodiscard]] virtual double bytes_per_tick() const = 0;
  [[nodiscard]] virtual MediumCounters counters() const = 0;
  // The next so many attempts to send a frame fail, and it is sent again: on a CAN bus. False, and no effect,
  // on all others, which send once.
  virtual bool fail_attempts(std::uint64_t /*count*/) { return false; }

 protected:
  Medium() = default;
};

}  // namespace palpate::link
