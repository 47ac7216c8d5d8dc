#include "shared/wire/transfer_monitor.hpp"

namespace palpate::wire {

TransferKind TransferMonitor::observe(const FrameHeader& header, std::uint32_t now_tick) {
  Entry* victim = &entries_[0];  // a free entry if there is one, otherwise the one silent longest
  for (Entry& entry : entries_) {
    if (!entry.used) {
      if (victim->used) victim = &entry;
      continue;
    }
    if (entry.source != header.source || entry.specifier != header.specifier) {
      if (victim->used && now_tick - entry.last_tick > now_tick - victim->last_tick) victim = &entry;
      continue;
    }
    const std::uint64_t step = (header.transfer_id - entry.last_id) & id_mask_;
    if (step == 0 && now_tick - entry.last_tick < kTransferIdTimeout_ticks) {
      ++repeated_;
      return TransferKind::repeat;
    }
    if (step > 1 && step <= kLargestTransferGap) lost_ += static_cast<std::uint32_t>(step - 1);
    entry.last_id = header.transfer_id;
    entry.last_tick = now_tick;
    return TransferKind::fresh;
  }
  *victim = {.used = true,
             .source = header.source,
             .specifier = header.specifier,
             .last_tick = now_tick,
             .last_id = header.transfer_id};
  return TransferKind::fresh;
}

}  // namespace palpate::wire
