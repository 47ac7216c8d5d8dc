#include "host/linearize/basis_schedule.hpp"

#include <algorithm>
#include <utility>

namespace palpate::host {

void BasisSchedule::begin_next(std::uint32_t tick) {
  const auto next =
      std::find_if(wanted_.begin(), wanted_.end(), [this](const Ports& p) { return !ready_.contains(p); });
  if (next == wanted_.end()) return;
  current_ = *next;
  done_tick_ = tick + latency_ticks_;
}

void BasisSchedule::want(std::uint32_t tick, std::vector<Ports> wanted) {
  const auto finish = [&] {
    while (current_ && done_tick_ <= tick) {
      ready_.insert(std::move(*current_));
      current_.reset();
      begin_next(done_tick_);
    }
  };
  finish();
  wanted_ = std::move(wanted);
  if (!current_) begin_next(tick);
  finish();  // without latency
}

}  // namespace palpate::host
