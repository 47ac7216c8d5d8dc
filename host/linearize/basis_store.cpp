#include "host/linearize/basis_store.hpp"

#include <algorithm>
#include <utility>

namespace palpate::host {
namespace {

// Bases that are remembered: 0.9 MB each for 12 x 12 x 12 nodes and 48 modes. A hand that draws over a face
// of such a body meets 81 patches of 4 x 4 nodes.
constexpr std::size_t kRemembered = 128;

}  // namespace

std::shared_ptr<const StoredBasis> BasisStore::basis(const std::vector<int>& ports) {
  const auto known =
      std::find_if(bases_.begin(), bases_.end(), [&](const Entry& e) { return e.first == ports; });
  if (known != bases_.end()) {
    bases_.splice(bases_.begin(), bases_, known);
  } else {
    WholeBodyBasis exact = reduction_.reduce(ports);
    bases_.emplace_front(ports, std::make_shared<const StoredBasis>(
                                    StoredBasis{std::move(exact.lambda_rad2_s2), std::move(exact.damping_1_s),
                                                exact.basis_1_sqrt_kg.cast<float>()}));
    ++computed_;
    if (bases_.size() > kRemembered) bases_.pop_back();
  }
  return bases_.front().second;
}

}  // namespace palpate::host
