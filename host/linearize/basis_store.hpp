// Bases of the whole body by their port nodes: constants of body and ports, computed once, by a thread of its
// own, and kept in memory and in files.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "host/linearize/basis_cache.hpp"
#include "host/linearize/basis_key.hpp"
#include "host/linearize/stored_basis.hpp"
#include "host/linearize/whole_body_basis.hpp"

namespace palpate::host {

using Ports = std::vector<int>;  // nodes, those in the middle first

// Where bases came from.
struct BasisCounts {
  std::size_t computed = 0, read = 0;  // read: from files
  std::size_t refused = 0;             // files that were not what they should be; computed anew
  std::size_t unsaved = 0;             // computed, but their file could not be written
  std::string problem;                 // the latest file refused or not written, and why
};

// Safe to use from several threads. Bases in memory are dropped when they are more than kMostBytes, those
// first that have been unused for longest, the latest two never.
class BasisStore {
 public:
  static constexpr std::size_t kMostBytes = 256U << 20U;

  // The body must outlive it. Without a cache there are no files. Throws std::invalid_argument for
  // frequencies as WholeBodyReduction does. The body is factored when the first basis is computed.
  BasisStore(const Body& body, Shifts shifts, std::optional<BasisCacheConfig> cache = std::nullopt);
  // Waits for the basis that is being computed.
  ~BasisStore();
  BasisStore(const BasisStore&) = delete;
  BasisStore& operator=(const BasisStore&) = delete;

  // Waits until it is there, before all that was requested. Never null; it stays valid for as long as it is
  // held. Throws what computing it threw.
  std::shared_ptr<const StoredBasis> basis(const Ports& ports);

  // Never waits: null if it is not in memory. Throws what computing it threw.
  std::shared_ptr<const StoredBasis> find(const Ports& ports);

  // To be computed in the background, in this order, instead of what was requested before and has not begun.
  void request(const std::vector<Ports>& wanted);

  [[nodiscard]] BasisCounts counts() const;

 private:
  using Entry = std::pair<Ports, std::shared_ptr<const StoredBasis>>;

  // With the lock held.
  std::shared_ptr<const StoredBasis> in_memory(const Ports& ports);
  void keep(const Ports& ports, std::shared_ptr<const StoredBasis> basis);
  void start();
  // On the thread.
  void work();
  std::shared_ptr<const StoredBasis> make(const Ports& ports);

  const Body& body_;
  const Shifts shifts_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;  // by either side
  std::list<Entry> bases_;           // latest used first
  std::size_t bytes_ = 0;
  std::map<Ports, std::exception_ptr> failed_;
  std::deque<Ports> waited_, wanted_;  // for the former a thread waits: they come first
  std::optional<Ports> current_;
  bool stop_ = false;
  BasisCounts counts_;
  std::thread thread_;
  // The thread's.
  std::unique_ptr<WholeBodyReduction> reduction_;
  std::optional<BasisCache> cache_;
  std::optional<BasisKeys> keys_;
};

}  // namespace palpate::host
