#include "host/linearize/surrounded_patch_builder.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "host/linearize/patch_selection.hpp"

namespace palpate::host {
namespace {

// Patches that are remembered: 74 kB each with 32 nodes. A hand that draws over a face of 12 x 12 nodes meets
// 81 of 4 x 4.
constexpr std::size_t kRemembered = 256;

}  // namespace

SurroundedPatchBuilder::SurroundedPatchBuilder(const Body& body, const PatchSize& patch, SurroundedBy by,
                                               double step_s, const LocalModelCapacity& capacity)
    : body_(body), patch_(patch), by_(by), step_s_(step_s), capacity_(capacity), body_around_(body) {}

const Surroundings& SurroundedPatchBuilder::around(const std::vector<int>& nodes) {
  const auto known =
      std::find_if(known_.begin(), known_.end(), [&](const Entry& e) { return e.first == nodes; });
  if (known != known_.end()) {
    known_.splice(known_.begin(), known_, known);
    return known_.front().second;
  }
  Surroundings surroundings;
  switch (by_) {
    case SurroundedBy::rescaled:
      surroundings.outside = body_around_.spring_factor(nodes);
      break;
    case SurroundedBy::condensed:
      surroundings.softening_N_m = body_around_.softening_N_m(nodes);
      break;
  }
  known_.emplace_front(nodes, std::move(surroundings));
  if (known_.size() > kRemembered) known_.pop_back();
  return known_.front().second;
}

LocalModel SurroundedPatchBuilder::build(const BodyState& state, const SurfacePoint& contact,
                                         const std::vector<int>& held) {
  if (!held.empty())
    throw std::invalid_argument("node " + std::to_string(held.front()) +
                                " is driven: what surrounds a patch does not know driven nodes");
  const std::vector<int> nodes = select_patch(body_, contact, patch_);
  return build_subset_model(body_, state, nodes, contact, step_s_, capacity_, {}, around(nodes));
}

}  // namespace palpate::host
