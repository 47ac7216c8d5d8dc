// Faults of a link, planned by frame: for tests of what is lost, what is refused and what goes on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
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

// A fault of one frame. Frames are numbered from 0 as they pass; a frame is what stands between delimiters.
struct Fault {
  std::uint64_t frame = 0;
  FaultKind kind = FaultKind::drop;
  std::size_t argument = 0;
};

// A filter between a sender and its medium: the same bytes in give the same bytes out, however they are cut.
// Bytes of a planned frame are held back until its end; all others pass at once. What is to come behind
// frames that never come does not come either.
class FaultPlan {
 public:
  FaultPlan() = default;
  // Throws std::invalid_argument when a frame has two faults, or is to be reordered behind no frame.
  explicit FaultPlan(std::span<const Fault> faults);

  // A fault more; its frame is counted from 0 among those that begin from now on. False, and no effect, when
  // that frame has one. Throws std::invalid_argument when it is to be reordered behind no frame.
  bool add(Fault fault);
  std::vector<std::uint8_t> apply(std::span<const std::uint8_t> bytes);
  [[nodiscard]] std::uint64_t frames_seen() const { return frame_; }
  [[nodiscard]] std::uint64_t faults_applied() const { return faults_applied_; }

 private:
  std::map<std::uint64_t, Fault> faults_;
  std::uint64_t frame_ = 0;  // number of the frame at hand
  bool in_frame_ = false;
  std::vector<std::uint8_t> held_;
  std::multimap<std::uint64_t, std::vector<std::uint8_t>> late_;  // by the frame that they come behind
  std::uint64_t faults_applied_ = 0;
};

}  // namespace palpate::link
