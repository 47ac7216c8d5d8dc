// When a basis is there, in virtual time: the computing thread as a run sees it, however fast the machine is.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include "host/linearize/basis_store.hpp"

namespace palpate::host {

// One basis at a time, each for `latency_ticks` from when it is begun. When one is done the first of those
// wanted then is begun. What has been computed once stays.
class BasisSchedule {
 public:
  explicit BasisSchedule(std::uint32_t latency_ticks) : latency_ticks_(latency_ticks) {}

  // What is wanted from this tick on, the most urgent first, instead of what was wanted before and has not
  // begun. Ticks do not go back.
  void want(std::uint32_t tick, std::vector<Ports> wanted);

  // As of the latest tick.
  [[nodiscard]] bool ready(const Ports& ports) const { return ready_.contains(ports); }
  [[nodiscard]] const std::optional<Ports>& current() const { return current_; }

 private:
  void begin_next(std::uint32_t tick);

  std::uint32_t latency_ticks_;
  std::vector<Ports> wanted_;
  std::optional<Ports> current_;
  std::uint32_t done_tick_ = 0;  // of current_
  std::set<Ports> ready_;
};

}  // namespace palpate::host
