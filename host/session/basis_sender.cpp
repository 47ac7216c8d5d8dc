#include "host/session/basis_sender.hpp"

#include <algorithm>
#include <utility>

namespace palpate::host {

std::size_t BasisSender::blocks() const {
  return (basis_->size() + palpate_ModelPart_1_0_BLOCK_BYTES - 1) / palpate_ModelPart_1_0_BLOCK_BYTES;
}

bool BasisSender::is_held(std::uint32_t id) const {
  return std::find(held_.begin(), held_.end(), id) != held_.end();
}

void BasisSender::begin(std::uint32_t id, Bytes basis) {
  basis_ = std::move(basis);
  id_ = id;
  wanted_.assign(blocks(), true);
  next_ = 0;
  waits_since_.reset();
  complete_ = false;
}

std::optional<palpate_ModelPart_1_0> BasisSender::next(std::size_t blocks, std::uint32_t tick) {
  if (!busy()) return std::nullopt;
  while (next_ < wanted_.size() && !wanted_[next_]) ++next_;
  if (next_ == wanted_.size()) {
    if (!waits_since_) waits_since_ = tick;
    if (tick - *waits_since_ < kAnswer_ticks) return std::nullopt;
    next_ = wanted_.size() - 1;
    wanted_[next_] = true;
  }
  waits_since_.reset();
  const std::size_t first = next_;
  while (next_ < wanted_.size() && next_ - first < blocks && wanted_[next_]) wanted_[next_++] = false;
  return wire::part_of(*basis_, id_, static_cast<std::uint16_t>(first), next_ - first);
}

void BasisSender::take(const palpate_BasisReport_1_0& report) {
  held_.assign(report.held.elements, report.held.elements + report.held.count);
  if (basis_ == nullptr || report.basis_id != id_) return;
  complete_ = is_held(id_);
  if (complete_) return;
  for (std::size_t block = 0; block < wanted_.size(); ++block) {
    // Of what is not known at all everything is missing.
    const bool missing = report.missing.count == 0 || block / 8 >= report.missing.count ||
                         (unsigned{report.missing.elements[block / 8]} >> block % 8 & 1u) != 0u;
    wanted_[block] = wanted_[block] || missing;
  }
  // The last block is what the board answers.
  wanted_.back() = true;
  next_ = 0;
}

}  // namespace palpate::host
