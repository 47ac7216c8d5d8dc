// Faults on a CAN bus by chance, between a sender and its medium: frames that are lost, or come twice.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "host/link/fault_plan.hpp"
#include "shared/wire/can_record.hpp"

namespace palpate::link {

// Bytes are CAN records (shared/wire/can_record.hpp). Of FaultKind a bus knows:
//   drop       a frame is destroyed and not sent again: a controller in its mode of single shots, or a
//   receiver
//              whose buffers are full. It costs no time on the bus here.
//   duplicate  a frame comes twice, one right behind the other. So it is when only the last bit of the end of
//              frame is hit: receivers take the frame (ISO 11898-1), its transmitter sends it again.
// Not here: a bit that flips makes every node signal an error, and the frame goes again (BusError of
// host/link/can_bus.hpp). A frame cannot be cut short, for its length code is under its CRC; and frames of
// one identifier keep their order, while those of different ones overtake each other in every run.
class CanFaultPlan {
 public:
  // Of several that hit one frame the first counts. Throws std::invalid_argument for other kinds, and for a
  // chance outside of 0 to 1.
  void add(const RandomFault& fault, std::uint32_t seed);
  // A fault more; its frame is counted from 0 among those that come from now on. False, and no effect, when
  // that frame has one. Throws std::invalid_argument for other kinds.
  bool add(Fault fault);
  // Whole records in, whole records out; `cut`: none passes. The rest of a record may come with the next
  // call.
  std::vector<std::uint8_t> apply(std::span<const std::uint8_t> bytes, std::uint32_t tick, bool cut = false);
  // Transfers of which a frame did not pass.
  [[nodiscard]] std::uint64_t transfers_spoilt() const { return transfers_spoilt_; }
  [[nodiscard]] std::uint64_t frames_seen() const { return frame_; }
  // Frames that were cut.
  [[nodiscard]] std::uint64_t frames_cut() const { return frames_cut_; }
  [[nodiscard]] const FaultCounts& faults_applied() const { return applied_; }

 private:
  // How often the frame that is at hand passes.
  [[nodiscard]] int copies(std::uint32_t tick);

  std::vector<FaultDraw> draws_;
  std::map<std::uint64_t, FaultKind> planned_;  // by the number of the frame
  wire::CanRecordReader reader_;
  std::map<std::uint32_t, bool> spoilt_;  // the present transfer of each identifier
  std::uint64_t frame_ = 0;               // number of the one at hand
  FaultCounts applied_{};
  std::uint64_t transfers_spoilt_ = 0, frames_cut_ = 0;
};

}  // namespace palpate::link
