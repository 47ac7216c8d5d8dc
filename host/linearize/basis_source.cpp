#include "host/linearize/basis_source.hpp"

namespace palpate::host {

void BasisSource::want(std::uint32_t tick, const std::vector<Ports>& wanted) {
  if (policy_.timing == BasisTiming::waits) return;
  if (policy_.timing == BasisTiming::as_it_comes) {
    store_.request(wanted);
    return;
  }
  schedule_.want(tick, wanted);
  // What the thread has not begun although its virtual time is over is computed when it is used, if it is.
  if (const auto& current = schedule_.current()) store_.request({*current});
}

std::shared_ptr<const StoredBasis> BasisSource::find(const Ports& ports) {
  if (policy_.timing == BasisTiming::as_it_comes) return store_.find(ports);
  if (policy_.timing == BasisTiming::virtual_time && !schedule_.ready(ports)) return nullptr;
  return store_.basis(ports);
}

}  // namespace palpate::host
