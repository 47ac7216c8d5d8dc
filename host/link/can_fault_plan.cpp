#include "host/link/can_fault_plan.hpp"

#include <stdexcept>
#include <string>

#include "host/link/can_record_bytes.hpp"
#include "shared/wire/can_frame.hpp"

namespace palpate::link {

namespace {

void require_of_can(FaultKind kind) {
  if (kind != FaultKind::drop && kind != FaultKind::duplicate)
    throw std::invalid_argument("CanFaultPlan: fault kind " + std::to_string(static_cast<int>(kind)) +
                                "; on a CAN bus frames are dropped or duplicated");
}

}  // namespace

void CanFaultPlan::add(const RandomFault& fault, std::uint32_t seed) {
  require_of_can(fault.kind);
  draws_.emplace_back(fault, seed);
}

bool CanFaultPlan::add(Fault fault) {
  require_of_can(fault.kind);
  return planned_.emplace(frame_ + fault.frame, fault.kind).second;
}

int CanFaultPlan::copies(std::uint32_t tick) {
  int copies = 1;
  const auto hit = [&](FaultKind kind) {
    copies = kind == FaultKind::drop ? 0 : 2;
    ++applied_[kind];
  };
  if (const auto planned = planned_.find(frame_); planned != planned_.end()) {
    hit(planned->second);
    planned_.erase(planned);
  }
  ++frame_;
  for (FaultDraw& draw : draws_) {
    if (!draw.lasts(tick) || !draw.hits() || copies != 1) continue;
    hit(draw.kind());
  }
  return copies;
}

std::vector<std::uint8_t> CanFaultPlan::apply(std::span<const std::uint8_t> bytes, std::uint32_t tick,
                                              bool cut) {
  std::vector<std::uint8_t> out;
  while (true) {
    const wire::CanRecordReader::Step step = reader_.read(bytes);
    bytes = bytes.subspan(step.consumed);
    if (step.found == wire::CanRecordReader::Found::nothing) return out;
    if (step.found == wire::CanRecordReader::Found::damage || step.frame.data.empty()) continue;
    bool& is_spoilt = spoilt_[step.frame.identifier];
    if (wire::parse_can_tail(step.frame.data.back()).start) is_spoilt = false;
    const int passes = copies(tick);
    if (cut) ++frames_cut_;
    if (cut || passes == 0) {
      if (!is_spoilt) ++transfers_spoilt_;
      is_spoilt = true;
      continue;
    }
    const std::vector<std::uint8_t> record = can_record_of(step.frame);
    for (int i = 0; i < passes; ++i) out.insert(out.end(), record.begin(), record.end());
  }
}

}  // namespace palpate::link
