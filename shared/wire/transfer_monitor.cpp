#include "shared/wire/transfer_monitor.hpp"

namespace palpate::wire {

// The newest transfer is so many ahead of the one before, at least 1.
void TransferMonitor::advance(Entry& entry, std::uint64_t step) {
  lost_ += static_cast<std::uint32_t>(step - 1);
  entry.again_run = 0;
  // Those of the gap that the window still holds.
  const unsigned shift = step < kTransferWindow ? static_cast<unsigned>(step) : kTransferWindow;
  const unsigned gap = (1u << shift) - 2u;
  entry.seen = static_cast<std::uint16_t>(unsigned{entry.seen} << shift | 1u);
  entry.missed = static_cast<std::uint16_t>(unsigned{entry.missed} << shift | gap);
}

// Of a transfer so many before the newest, that came before: is it one of a run that began again?
bool TransferMonitor::begins_again(Entry& entry, unsigned back) {
  const bool follows = entry.again_run > 0 && back + 1u == entry.again_back;
  entry.again_run = static_cast<std::uint8_t>(follows ? entry.again_run + 1u : 1u);
  entry.again_back = static_cast<std::uint8_t>(back);
  return entry.again_run >= kRestartRun;
}

// Of one that did not. One before the first of the port was not counted as lost.
void TransferMonitor::take_late(Entry& entry, unsigned back) {
  const unsigned bit = 1u << back;
  if ((entry.missed & bit) != 0) --lost_;
  entry.seen = static_cast<std::uint16_t>(entry.seen | bit);
  entry.missed = static_cast<std::uint16_t>(entry.missed & ~bit);
  entry.again_run = 0;
  ++late_;
}

void TransferMonitor::forget(std::uint16_t source) {
  for (Entry& entry : entries_) entry.used = entry.used && entry.source != source;
}

TransferKind TransferMonitor::observe(const FrameHeader& header, std::uint32_t now_tick) {
  // The port's; else a free one if there is one, otherwise the one silent longest.
  Entry* place = &entries_[0];
  bool known = false;
  for (Entry& entry : entries_) {
    if (!entry.used) {
      if (place->used) place = &entry;
      continue;
    }
    if (entry.source == header.source && entry.specifier == header.specifier) {
      place = &entry;
      known = true;
      break;
    }
    if (place->used && now_tick - entry.last_tick > now_tick - place->last_tick) place = &entry;
  }
  const std::uint64_t back = (place->last_id - header.transfer_id) & id_mask_;
  const bool in_time = now_tick - place->last_tick < kTransferIdTimeout_ticks;
  if (known) {
    const std::uint64_t step = (header.transfer_id - place->last_id) & id_mask_;
    if (back < window_ && in_time) {
      const auto before = static_cast<unsigned>(back);
      if ((unsigned{place->seen} >> before & 1u) == 0) {
        take_late(*place, before);
        return TransferKind::fresh;
      }
      if (!begins_again(*place, before)) {
        ++repeated_;
        return TransferKind::repeat;
      }
    } else if (step > 0 && step <= kLargestTransferGap) {
      advance(*place, step);
      place->last_id = header.transfer_id;
      place->last_tick = now_tick;
      return TransferKind::fresh;
    }
  }
  // A port that is new, or a peer that started again: then all of its ports begin anew. A number of before
  // that comes after the timeout says so of its own port only.
  if (known && (back >= window_ || in_time)) forget(header.source);
  *place = {.used = true,
            .source = header.source,
            .specifier = header.specifier,
            .last_tick = now_tick,
            .last_id = header.transfer_id};
  return TransferKind::fresh;
}

}  // namespace palpate::wire
