// Bases of local models on the board: three of them, put together from their pieces where they are used.
//
// Three, for the active model and its shadow may each have their own while the next one comes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "palpate/ModelPart_1_0.h"
#include "shared/status.hpp"
#include "shared/wire/crc.hpp"
#include "shared/wire/model_basis.hpp"

namespace palpate::firmware {

inline constexpr std::size_t kBasisSlots = 3;
inline constexpr std::size_t kBasisBlockBytes = palpate_ModelPart_1_0_BLOCK_BYTES;
inline constexpr std::size_t kMaxBasisBlocks =
    (wire::kMaxBasisBytes + kBasisBlockBytes - 1) / kBasisBlockBytes;
// Bytes of which the CRC is taken in one call of check(): about 6 instructions each.
inline constexpr std::size_t kCheckedBytesPerRun = 4096;

// Background context throughout; what complete() returned may be read anywhere.
class BasisStore {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  using Blocks = std::array<std::uint8_t, (kMaxBasisBlocks + 7) / 8>;  // a bit per block, lowest first

  // What a piece or a check has come to.
  struct Event {
    std::uint32_t id = 0;
    // ok: complete. basis_missing: its last block is there, others are not. basis_part_invalid: refused.
    Status status = Status::ok;
  };
  struct Events {
    std::array<Event, 2> event{};
    std::size_t count = 0;
    void add(const Event& one) { event[count++] = one; }
  };

  // Takes a piece. `in_use`: a bit per slot that must stay as it is. Another one is taken for a basis that is
  // not known yet: an empty one, else the one that was asked for longest ago; what was under way there is
  // dropped (an event with basis_dropped). Where there is no other one the piece is: the event comes with the
  // last piece.
  Events add(const palpate_ModelPart_1_0& part, std::uint32_t in_use);
  // Goes on with the CRC of a basis whose pieces have all come. An event when that is done, at most one.
  Events check();

  // Slot of a complete basis; kNone: there is none of that identifier. Counts as asking for it.
  std::uint32_t find_complete(std::uint32_t id);
  [[nodiscard]] std::span<const std::uint8_t> bytes(std::uint32_t slot) const {
    return std::span(slots_[slot].bytes).first(slots_[slot].length);
  }
  // Length of a basis that has begun to come; 0: unknown. `missing`: its blocks that are not there.
  std::size_t missing(std::uint32_t id, Blocks& missing) const;
  // Identifier of the complete basis in the slot; 0: none.
  [[nodiscard]] std::uint32_t held(std::uint32_t slot) const {
    return slots_[slot].complete ? slots_[slot].id : 0;
  }
  // The slot of a basis as one bit, 0 where it has none.
  [[nodiscard]] std::uint32_t slot_bit(std::uint32_t id) const {
    const std::uint32_t slot = find(id);
    return slot == kNone ? 0u : 1u << slot;
  }

 private:
  struct Slot {
    alignas(8) std::array<std::uint8_t, wire::kMaxBasisBytes> bytes{};
    std::size_t length = 0;
    std::uint32_t id = 0;  // 0: empty
    Blocks come{};
    std::size_t blocks_come = 0;
    std::size_t checked = 0;  // bytes from the beginning that crc covers
    std::uint32_t crc = wire::kCrc32cInitial;
    std::uint32_t asked = 0;  // by uses_: when it was asked for last
    bool complete = false;

    [[nodiscard]] std::size_t blocks() const { return (length + kBasisBlockBytes - 1) / kBasisBlockBytes; }
    [[nodiscard]] bool has(std::size_t block) const {
      return (unsigned{come[block / 8]} >> block % 8 & 1u) != 0u;
    }
  };
  std::uint32_t find(std::uint32_t id) const;
  // kNone: all slots are in use.
  std::uint32_t make_room(std::uint32_t in_use, Events& events);
  // Takes the CRC of what has come without a gap from the beginning.
  static void take_crc(Slot& slot);
  static Status finish(Slot& slot);

  std::array<Slot, kBasisSlots> slots_{};
  std::uint32_t uses_ = 0;
};

}  // namespace palpate::firmware
