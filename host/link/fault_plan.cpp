#include "host/link/fault_plan.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "shared/wire/cobs.hpp"

namespace palpate::link {
namespace {

// What chance draws: a bit of a frame modulo its length, its length after a cut, and the frames that go
// before.
constexpr std::size_t kMostBits = 1u << 16, kMostCut = 64, kMostBehind = 3;

bool comes_late(FaultKind kind) {
  return kind == FaultKind::duplicate || kind == FaultKind::reorder;
}

// Does a frame of so many bytes not come whole?
bool spoils(const Fault& fault, std::size_t bytes) {
  return !comes_late(fault.kind) && (fault.kind != FaultKind::truncate || fault.argument < bytes);
}

// What becomes at once of a frame (without delimiters, not empty), its last delimiter included.
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
    case FaultKind::duplicate:
      frame.push_back(wire::kCobsDelimiter);
      return frame;
    case FaultKind::reorder:
      return {};
  }
  throw std::invalid_argument("FaultPlan: unknown fault kind " +
                              std::to_string(static_cast<int>(fault.kind)));
}

}  // namespace

FaultDraw::FaultDraw(const RandomFault& fault, std::uint32_t seed) : fault_(fault), random_(seed) {
  if (!(fault.chance >= 0.0 && fault.chance <= 1.0))
    throw std::invalid_argument("FaultDraw: chance " + std::to_string(fault.chance) + " is not in 0..1");
}

bool FaultDraw::hits() {
  constexpr double kRange = 4294967296.0;
  return static_cast<double>(random_()) / kRange < fault_.chance;
}

FaultPlan::FaultPlan(std::span<const Fault> faults) {
  for (const Fault& fault : faults)
    if (!add(fault))
      throw std::invalid_argument("FaultPlan: frame " + std::to_string(fault.frame) +
                                  " has two faults; 1 is allowed");
}

bool FaultPlan::add(Fault fault) {
  if (fault.kind == FaultKind::reorder && fault.argument == 0)
    throw std::invalid_argument("FaultPlan: frame " + std::to_string(fault.frame) +
                                " is to come behind 0 frames; at least 1 is allowed");
  fault.frame += frame_ + (in_frame_ ? 1 : 0);
  return faults_.emplace(fault.frame, fault).second;
}

void FaultPlan::add(const RandomFault& fault, std::uint32_t seed) {
  draws_.emplace_back(fault, seed);
}

// A frame begins.
void FaultPlan::draw(std::uint32_t tick) {
  for (FaultDraw& draw : draws_) {
    if (!draw.lasts(tick)) continue;
    const bool hit = draw.hits();
    const std::size_t number = draw.number();
    if (!hit) continue;
    const bool late = comes_late(draw.kind());
    const std::size_t length = draw.kind() == FaultKind::truncate ? kMostCut : kMostBits;
    faults_.emplace(frame_, Fault{frame_, draw.kind(), late ? 1 + number % kMostBehind : number % length});
  }
}

std::vector<std::uint8_t> FaultPlan::apply(std::span<const std::uint8_t> bytes, std::uint32_t tick) {
  std::vector<std::uint8_t> out;
  out.reserve(bytes.size());
  for (const std::uint8_t byte : bytes) {
    if (byte != wire::kCobsDelimiter && !in_frame_) draw(tick);
    const auto planned = faults_.find(frame_);
    if (byte != wire::kCobsDelimiter) {
      in_frame_ = true;
      (planned == faults_.end() ? out : held_).push_back(byte);
      continue;
    }
    if (in_frame_ && planned != faults_.end()) {
      if (comes_late(planned->second.kind)) {
        std::vector<std::uint8_t> late = held_;
        late.push_back(wire::kCobsDelimiter);
        late_.emplace(frame_ + planned->second.argument, std::move(late));
      }
      const bool is_spoilt = spoils(planned->second, held_.size());
      ++applied_[planned->second.kind];
      const std::vector<std::uint8_t> spoilt = spoil(std::move(held_), planned->second);
      out.insert(out.end(), spoilt.begin(), spoilt.end());
      held_.clear();
      if (is_spoilt) ++frames_spoilt_;
    } else {
      out.push_back(byte);
    }
    if (in_frame_) {
      for (auto late = late_.begin(); late != late_.end() && late->first <= frame_; late = late_.erase(late))
        out.insert(out.end(), late->second.begin(), late->second.end());
      ++frame_;
    }
    in_frame_ = false;
  }
  return out;
}

}  // namespace palpate::link
