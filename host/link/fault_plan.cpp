#include "host/link/fault_plan.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "shared/wire/cobs.hpp"

namespace palpate::link {
namespace {

// What becomes of a frame (without delimiters, not empty), its last delimiter included.
std::vector<std::uint8_t> spoil(std::vector<std::uint8_t> frame, const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::drop:
      return {};
    case FaultKind::truncate:
      frame.resize(std::min(fault.argument, frame.size()));
      return frame;
    case FaultKind::flip_bit: {
      const std::size_t bit = fault.argument % (8 * frame.size());
      frame[bit / 8] = static_cast<std::uint8_t>(frame[bit / 8] ^ (1u << (bit % 8)));
      frame.push_back(wire::kCobsDelimiter);
      return frame;
    }
    case FaultKind::duplicate: {
      frame.push_back(wire::kCobsDelimiter);
      const std::size_t length = frame.size();
      frame.resize(2 * length);
      std::copy_n(frame.begin(), length, frame.begin() + static_cast<std::ptrdiff_t>(length));
      return frame;
    }
  }
  throw std::invalid_argument("FaultPlan: unknown fault kind " +
                              std::to_string(static_cast<int>(fault.kind)));
}

}  // namespace

FaultPlan::FaultPlan(std::span<const Fault> faults) {
  for (const Fault& fault : faults)
    if (!faults_.emplace(fault.frame, fault).second)
      throw std::invalid_argument("FaultPlan: frame " + std::to_string(fault.frame) +
                                  " has two faults; 1 is allowed");
}

std::vector<std::uint8_t> FaultPlan::apply(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> out;
  out.reserve(bytes.size());
  for (const std::uint8_t byte : bytes) {
    const auto planned = faults_.find(frame_);
    if (byte != wire::kCobsDelimiter) {
      in_frame_ = true;
      (planned == faults_.end() ? out : held_).push_back(byte);
      continue;
    }
    if (in_frame_ && planned != faults_.end()) {
      const std::vector<std::uint8_t> spoilt = spoil(std::move(held_), planned->second);
      out.insert(out.end(), spoilt.begin(), spoilt.end());
      held_.clear();
      ++faults_applied_;
    } else {
      out.push_back(byte);
    }
    if (in_frame_) ++frame_;
    in_frame_ = false;
  }
  return out;
}

}  // namespace palpate::link
