// Faults of a link, planned by frame: for tests of what is lost, what is refused and what goes on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <span>
#include <vector>

namespace palpate::link {

enum class FaultKind : std::uint8_t {
  drop,       // the frame vanishes
  flip_bit,   // bit `argument` of it, modulo its length, is inverted
  truncate,   // only its first `argument` bytes come, no delimiter behind them
  duplicate,  // it comes again, behind the next `argument` frames
  reorder,    // it comes behind the next `argument` frames, 1 at least
};

inline constexpr std::size_t kFaultKinds = 5;

// How many frames were hit, by FaultKind.
struct FaultCounts {
  std::array<std::uint64_t, kFaultKinds> hit{};

  std::uint64_t& operator[](FaultKind kind) { return hit.at(static_cast<std::size_t>(kind)); }
  std::uint64_t operator[](FaultKind kind) const { return hit.at(static_cast<std::size_t>(kind)); }
  [[nodiscard]] std::uint64_t sum() const {
    return std::accumulate(hit.begin(), hit.end(), std::uint64_t{0});
  }
};

// A fault of one frame. Frames are numbered from 0 as they pass; a frame is what stands between delimiters.
struct Fault {
  std::uint64_t frame = 0;
  FaultKind kind = FaultKind::drop;
  std::size_t argument = 0;
};

// Faults by chance: each frame that begins in one of the ticks from first_tick on, before end_tick, is hit
// with that chance. The bit, the length or the number of frames are drawn, too; the same seed draws the same.
struct RandomFault {
  FaultKind kind = FaultKind::drop;
  double chance = 0.0;  // 0 to 1
  std::uint32_t first_tick = 0;
  std::uint32_t end_tick = 0xffffffffu;
};

// Draws which frames such a fault hits, from the generator's own numbers alone: the distributions of the
// standard library differ between libraries.
class FaultDraw {
 public:
  // Throws std::invalid_argument for a chance outside of 0 to 1.
  FaultDraw(const RandomFault& fault, std::uint32_t seed);
  [[nodiscard]] FaultKind kind() const { return fault_.kind; }
  [[nodiscard]] bool lasts(std::uint32_t tick) const {
    return tick >= fault_.first_tick && tick < fault_.end_tick;
  }
  // Is the next frame hit?
  bool hits();
  std::size_t number() { return random_(); }

 private:
  RandomFault fault_;
  std::mt19937 random_;
};

// A filter between a sender and its medium: the same bytes in give the same bytes out, however they are cut.
// Bytes of a planned frame are held back until its end; all others pass at once. What is to come behind
// frames that never come does not come either.
class FaultPlan {
 public:
  FaultPlan() = default;
  // Throws std::invalid_argument when a frame has two faults, or is to be reordered behind no frame.
  explicit FaultPlan(std::span<const Fault> faults);

  // Of several that hit one frame the first counts, and a fault that is planned before any of them. Throws
  // std::invalid_argument for a chance outside of 0 to 1.
  void add(const RandomFault& fault, std::uint32_t seed);

  // A fault more; its frame is counted from 0 among those that begin from now on. False, and no effect, when
  // that frame has one. Throws std::invalid_argument when it is to be reordered behind no frame.
  bool add(Fault fault);
  // `tick`: now; for faults by chance only.
  std::vector<std::uint8_t> apply(std::span<const std::uint8_t> bytes, std::uint32_t tick = 0);
  [[nodiscard]] std::uint64_t frames_seen() const { return frame_; }
  [[nodiscard]] const FaultCounts& faults_applied() const { return applied_; }
  // Of those the ones after which the frame does not come whole: dropped, cut short or with another bit.
  [[nodiscard]] std::uint64_t frames_spoilt() const { return frames_spoilt_; }

 private:
  void draw(std::uint32_t tick);

  std::vector<FaultDraw> draws_;
  std::map<std::uint64_t, Fault> faults_;
  std::uint64_t frame_ = 0;  // number of the frame at hand
  bool in_frame_ = false;
  std::vector<std::uint8_t> held_;
  std::multimap<std::uint64_t, std::vector<std::uint8_t>> late_;  // by the frame that they come behind
  FaultCounts applied_{};
  std::uint64_t frames_spoilt_ = 0;
};

}  // namespace palpate::link
