#include "host/session/trace_choice.hpp"

#include <algorithm>

namespace palpate::host {

void TraceChoice::take(const palpate_BoardStatus_1_0& status) {
  ask_ = status.trace_form != static_cast<std::uint8_t>(wish_.form) || status.trace_ticks != wish_.ticks;
}

std::optional<palpate_TraceRequest_1_0> TraceChoice::poll() {
  if (!ask_) return std::nullopt;
  ask_ = false;
  return request({});
}

palpate_TraceRequest_1_0 TraceChoice::request(const TickRange& ticks) const {
  constexpr std::uint32_t kMostTicks = 256;  // palpate.TraceRequest
  palpate_TraceRequest_1_0 request{};
  request.first_tick = ticks.first;
  request.count = static_cast<std::uint16_t>(std::min(ticks.count, kMostTicks));
  request.form = static_cast<std::uint8_t>(wish_.form);
  request.ticks = wish_.ticks;
  return request;
}

}  // namespace palpate::host
