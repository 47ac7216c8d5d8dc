#include "firmware/core/basis_store.hpp"

#include <algorithm>

namespace palpate::firmware {

std::uint32_t BasisStore::find(std::uint32_t id) const {
  for (std::uint32_t slot = 0; slot < kBasisSlots; ++slot)
    if (slots_[slot].id == id && id != 0) return slot;
  return kNone;
}

std::uint32_t BasisStore::find_complete(std::uint32_t id) {
  const std::uint32_t slot = find(id);
  if (slot == kNone || !slots_[slot].complete) return kNone;
  slots_[slot].asked = ++uses_;
  return slot;
}

std::uint32_t BasisStore::make_room(std::uint32_t in_use, Events& events) {
  std::uint32_t oldest = kNone;
  for (std::uint32_t slot = 0; slot < kBasisSlots; ++slot) {
    if ((in_use >> slot & 1u) != 0u) continue;
    if (oldest == kNone || slots_[slot].id == 0 ||
        (slots_[oldest].id != 0 && slots_[slot].asked < slots_[oldest].asked))
      oldest = slot;
  }
  if (oldest == kNone) return kNone;
  Slot& slot = slots_[oldest];
  if (slot.id != 0 && !slot.complete) events.add({slot.id, Status::basis_dropped});
  slot.id = 0;
  slot.come = {};
  slot.blocks_come = 0;
  slot.checked = 0;
  slot.crc = wire::kCrc32cInitial;
  slot.complete = false;
  return oldest;
}

BasisStore::Events BasisStore::add(const palpate_ModelPart_1_0& part, std::uint32_t in_use) {
  Events events;
  const std::size_t begin = std::size_t{part.first_block} * kBasisBlockBytes, end = begin + part.data.count;
  const bool whole_blocks = part.data.count % kBasisBlockBytes == 0 || end == part.basis_bytes;
  if (part.basis_id == 0 || part.basis_bytes > wire::kMaxBasisBytes || part.data.count == 0 ||
      end > part.basis_bytes || !whole_blocks) {
    events.add({part.basis_id, Status::basis_part_invalid});
    return events;
  }
  std::uint32_t found = find(part.basis_id);
  if (found == kNone) {
    found = make_room(in_use, events);
    if (found == kNone) {
      if (end == part.basis_bytes) events.add({part.basis_id, Status::basis_dropped});
      return events;
    }
    slots_[found].id = part.basis_id;
    slots_[found].length = part.basis_bytes;
  }
  Slot& slot = slots_[found];
  if (slot.length != part.basis_bytes) {
    events.add({part.basis_id, Status::basis_part_invalid});
    return events;
  }
  slot.asked = ++uses_;
  const std::size_t first = part.first_block, last = (end - 1) / kBasisBlockBytes;
  if (!slot.complete) {
    for (std::size_t block = first; block <= last; ++block) {
      if (slot.has(block)) continue;
      const std::size_t from = block * kBasisBlockBytes, until = std::min(from + kBasisBlockBytes, end);
      std::copy(part.data.elements + (from - begin), part.data.elements + (until - begin),
                slot.bytes.begin() + static_cast<std::ptrdiff_t>(from));
      slot.come[block / 8] = static_cast<std::uint8_t>(slot.come[block / 8] | 1u << block % 8);
      ++slot.blocks_come;
    }
    take_crc(slot);
  }
  if (slot.complete) {
    if (last + 1 == slot.blocks()) events.add({slot.id, Status::ok});
  } else if (slot.checked == slot.length) {
    const std::uint32_t id = slot.id;
    events.add({id, finish(slot)});
  } else if (last + 1 == slot.blocks() && slot.blocks_come != slot.blocks()) {
    events.add({slot.id, Status::basis_missing});
  }
  return events;
}

BasisStore::Events BasisStore::check() {
  Events events;
  for (Slot& slot : slots_) {
    if (slot.id == 0 || slot.complete || slot.blocks_come != slot.blocks()) continue;
    take_crc(slot);
    const std::uint32_t id = slot.id;
    if (slot.checked == slot.length) events.add({id, finish(slot)});
    break;
  }
  return events;
}

void BasisStore::take_crc(Slot& slot) {
  const std::size_t until = std::min(slot.length, slot.checked + kCheckedBytesPerRun);
  while (slot.checked < until && slot.has(slot.checked / kBasisBlockBytes)) {
    const std::size_t length = std::min(kBasisBlockBytes, slot.length - slot.checked);
    slot.crc = wire::crc32c_update(slot.crc, std::span(slot.bytes).subspan(slot.checked, length));
    slot.checked += length;
  }
}

Status BasisStore::finish(Slot& slot) {
  if (wire::basis_id_of(slot.crc) == slot.id) {
    slot.complete = true;
    return Status::ok;
  }
  slot.id = 0;
  return Status::basis_crc_mismatch;
}

std::size_t BasisStore::missing(std::uint32_t id, Blocks& missing) const {
  missing = {};
  const std::uint32_t found = find(id);
  if (found == kNone) return 0;
  const Slot& slot = slots_[found];
  for (std::size_t block = 0; block < slot.blocks(); ++block)
    if (!slot.has(block))
      missing[block / 8] = static_cast<std::uint8_t>(missing[block / 8] | 1u << block % 8);
  return slot.length;
}

}  // namespace palpate::firmware
