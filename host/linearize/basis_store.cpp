#include "host/linearize/basis_store.hpp"

#include <algorithm>

namespace palpate::host {

BasisStore::BasisStore(const Body& body, Shifts shifts, std::optional<BasisCacheConfig> cache)
    : body_(body), shifts_(std::move(shifts)) {
  require_shifts(shifts_);
  if (cache) cache_.emplace(std::move(*cache));
}

BasisStore::~BasisStore() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<const StoredBasis> BasisStore::in_memory(const Ports& ports) {
  if (const auto error = failed_.find(ports); error != failed_.end()) std::rethrow_exception(error->second);
  const auto known =
      std::find_if(bases_.begin(), bases_.end(), [&](const Entry& e) { return e.first == ports; });
  if (known == bases_.end()) return nullptr;
  bases_.splice(bases_.begin(), bases_, known);
  return known->second;
}

void BasisStore::keep(const Ports& ports, std::shared_ptr<const StoredBasis> basis) {
  bytes_ += basis->bytes();
  bases_.emplace_front(ports, std::move(basis));
  while (bytes_ > kMostBytes && bases_.size() > 2) {
    bytes_ -= bases_.back().second->bytes();
    bases_.pop_back();
  }
}

void BasisStore::start() {
  if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
}

std::shared_ptr<const StoredBasis> BasisStore::basis(const Ports& ports) {
  std::unique_lock lock(mutex_);
  for (;;) {
    if (auto found = in_memory(ports)) return found;
    // Once: threads that wait for different ones would push each other back for ever.
    if (current_ != ports && std::find(waited_.begin(), waited_.end(), ports) == waited_.end()) {
      waited_.push_back(ports);
      start();
      changed_.notify_all();
    }
    changed_.wait(lock);
  }
}

std::shared_ptr<const StoredBasis> BasisStore::find(const Ports& ports) {
  const std::lock_guard lock(mutex_);
  return in_memory(ports);
}

void BasisStore::request(const std::vector<Ports>& wanted) {
  {
    const std::lock_guard lock(mutex_);
    wanted_.assign(wanted.begin(), wanted.end());
    if (wanted_.empty()) return;
    start();
  }
  changed_.notify_all();
}

BasisCounts BasisStore::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void BasisStore::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || !waited_.empty() || !wanted_.empty(); });
    if (stop_) return;
    std::deque<Ports>& queue = waited_.empty() ? wanted_ : waited_;
    const Ports ports = std::move(queue.front());
    queue.pop_front();
    if (failed_.contains(ports) ||
        std::any_of(bases_.begin(), bases_.end(), [&](const Entry& e) { return e.first == ports; }))
      continue;
    current_ = ports;
    lock.unlock();
    std::shared_ptr<const StoredBasis> made;
    std::exception_ptr error;
    try {
      made = make(ports);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    current_.reset();
    if (made) {
      keep(ports, std::move(made));
    } else {
      failed_.emplace(ports, error);
    }
    changed_.notify_all();
  }
}

std::shared_ptr<const StoredBasis> BasisStore::make(const Ports& ports) {
  if (cache_) {
    if (!keys_) keys_.emplace(body_, shifts_);
    const auto most_modes = static_cast<Eigen::Index>(shifts_.most_modes(static_cast<int>(ports.size())));
    std::string refusal;
    auto kept = cache_->load(keys_->of(ports), body_.dof_count(), most_modes, refusal);
    const std::lock_guard lock(mutex_);
    if (!refusal.empty()) {
      ++counts_.refused;
      counts_.problem = std::move(refusal);
    }
    if (kept) {
      ++counts_.read;
      return std::make_shared<const StoredBasis>(std::move(*kept));
    }
  }
  if (!reduction_) reduction_ = std::make_unique<WholeBodyReduction>(body_, shifts_);
  auto made = std::make_shared<const StoredBasis>(stored(reduction_->reduce(ports)));
  std::string problem;
  if (cache_) problem = cache_->save(keys_->of(ports), *made);
  const std::lock_guard lock(mutex_);
  ++counts_.computed;
  if (!problem.empty()) {
    ++counts_.unsaved;
    counts_.problem = std::move(problem);
  }
  return made;
}

}  // namespace palpate::host
