// Bases for a session: what it may use now, and what is to be computed meanwhile.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "host/linearize/basis_schedule.hpp"
#include "host/linearize/basis_store.hpp"

namespace palpate::host {

enum class BasisTiming {
  waits,         // the session waits for each basis
  virtual_time,  // from a stated latency on; the run waits in real time where the machine is slower
  as_it_comes,   // from when it is computed on; for sessions in real time, never for results to be repeated
};

struct BasisPolicy {
  BasisTiming timing = BasisTiming::waits;
  std::uint32_t latency_ticks = 100;  // that a basis takes; as_it_comes: that it is expected to take
  std::optional<BasisCacheConfig> cache;
};

class BasisSource {
 public:
  // As BasisStore.
  BasisSource(const Body& body, const Shifts& shifts, const BasisPolicy& policy)
      : policy_(policy), schedule_(policy.latency_ticks), store_(body, shifts, policy.cache) {}

  // What the session wants from this tick on, the most urgent first.
  void want(std::uint32_t tick, const std::vector<Ports>& wanted);

  // Null: not yet. Throws what computing it threw.
  std::shared_ptr<const StoredBasis> find(const Ports& ports);

  [[nodiscard]] const BasisPolicy& policy() const { return policy_; }
  [[nodiscard]] BasisCounts counts() const { return store_.counts(); }

 private:
  BasisPolicy policy_;
  BasisSchedule schedule_;
  BasisStore store_;
};

}  // namespace palpate::host
