// Keeps a few bytes in flash so that a loss of power at any moment leaves either what was there before or
// what is new.
//
// There are two slots, each a page of its own. What is written goes to the slot that does not hold the newest
// record, so that one stays as it is until the other is complete. A slot:
//   bytes 0 to 7    magic "PLP1", length of the content
//   bytes 8 to 15   sequence, its complement
//   from 16 on      the content, with zeros up to a multiple of 8
//   last 8          CRC-32C of all before, its complement; written last, makes the record valid
// The slot with the higher sequence (modulo 2^32) is the newest.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "shared/wire/crc.hpp"

namespace palpate::stm32g4 {

// Flash as it is written: erased by slot, programmed by 8 bytes, once each.
template <class F>
concept SlottedFlash = requires(F& flash, std::uint32_t slot, std::uint32_t offset, std::uint64_t value) {
  // A constant: bytes of a slot.
  { F::kSlot_bytes } -> std::convertible_to<std::uint32_t>;
  // False: it has failed. All bytes are 0xFF afterwards.
  { flash.erase(slot) } -> std::same_as<bool>;
  { flash.program(slot, offset, value) } -> std::same_as<bool>;
  // False: not readable, as half-written bytes may be.
  { flash.read(slot, offset, value) } -> std::same_as<bool>;
};

enum class StoreResult : std::uint32_t {
  ok = 0,
  empty = 1,          // nothing has been written, or nothing of this length
  too_long = 2,       // more than a slot holds
  flash_failed = 3,   // what was there before is there still
  not_supported = 4,  // the part is not set up for it
};

// Background context.
template <SlottedFlash Flash>
class ParameterStore {
 public:
  static constexpr std::uint32_t kMax_bytes = Flash::kSlot_bytes - 24;

  explicit ParameterStore(Flash& flash) : flash_(flash) {}

  // The newest content, if it is as long as `out`; otherwise `out` stays as it is.
  StoreResult read(std::span<std::uint8_t> out) {
    const Newest newest = find();
    if (newest.slot == kNone || newest.length != out.size()) return StoreResult::empty;
    for (std::uint32_t at = 0; at < newest.length; at += kUnit) {
      std::uint64_t value = 0;
      if (!flash_.read(newest.slot, kHead_bytes + at, value)) return StoreResult::flash_failed;
      std::memcpy(out.data() + at, &value, least(kUnit, newest.length - at));
    }
    return StoreResult::ok;
  }

  StoreResult write(std::span<const std::uint8_t> content) {
    if (content.size() > kMax_bytes) return StoreResult::too_long;
    const Newest newest = find();
    const std::uint32_t slot = newest.slot == 0 ? 1 : 0;
    if (!flash_.erase(slot)) return StoreResult::flash_failed;
    const auto length = static_cast<std::uint32_t>(content.size());
    const std::uint32_t sequence = newest.slot == kNone ? 1 : newest.sequence + 1;
    Writer writer{flash_, slot};
    writer.put(pair(kMagic, length));
    writer.put(pair(sequence, ~sequence));
    for (std::uint32_t at = 0; at < length; at += kUnit) {
      std::uint64_t value = 0;
      std::memcpy(&value, content.data() + at, least(kUnit, length - at));
      writer.put(value);
    }
    const std::uint32_t crc = wire::crc32c_value(writer.crc);
    writer.put(pair(crc, ~crc));
    // What was written is what is read: a worn page shows here.
    const Newest now = find();
    const bool is_there = writer.good && now.slot == slot && now.sequence == sequence && now.length == length;
    return is_there ? StoreResult::ok : StoreResult::flash_failed;
  }

 private:
  static constexpr std::uint32_t kUnit = 8;
  static constexpr std::uint32_t kHead_bytes = 16;
  static constexpr std::uint32_t kMagic = 0x31504C50;
  static constexpr std::uint32_t kSlots = 2;
  static constexpr std::uint32_t kNone = kSlots;

  struct Newest {
    std::uint32_t slot = kNone;
    std::uint32_t sequence = 0;
    std::uint32_t length = 0;
  };
  struct Writer {
    Flash& flash;
    std::uint32_t slot;
    std::uint32_t offset = 0;
    std::uint32_t crc = wire::kCrc32cInitial;
    bool good = true;

    void put(std::uint64_t value) {
      if (good) good = flash.program(slot, offset, value);
      crc = with(crc, value);
      offset += kUnit;
    }
  };

  static std::uint32_t least(std::uint32_t a, std::uint32_t b) { return a < b ? a : b; }
  static std::uint64_t pair(std::uint32_t low, std::uint32_t high) {
    return low | (std::uint64_t{high} << 32);
  }
  static std::uint32_t low(std::uint64_t both) { return static_cast<std::uint32_t>(both); }
  static std::uint32_t high(std::uint64_t both) { return static_cast<std::uint32_t>(both >> 32); }
  static std::uint32_t with(std::uint32_t crc, std::uint64_t value) {
    std::array<std::uint8_t, kUnit> bytes;
    std::memcpy(bytes.data(), &value, kUnit);
    return wire::crc32c_update(crc, bytes);
  }

  // Is there a whole record in the slot?
  bool look(std::uint32_t slot, Newest& found) {
    std::uint64_t head = 0, order = 0;
    if (!flash_.read(slot, 0, head) || low(head) != kMagic || high(head) > kMax_bytes) return false;
    if (!flash_.read(slot, kUnit, order) || high(order) != ~low(order)) return false;
    std::uint32_t crc = with(with(wire::kCrc32cInitial, head), order);
    const std::uint32_t end = kHead_bytes + (high(head) + kUnit - 1) / kUnit * kUnit;
    std::uint64_t value = 0;
    for (std::uint32_t at = kHead_bytes; at < end; at += kUnit) {
      if (!flash_.read(slot, at, value)) return false;
      crc = with(crc, value);
    }
    const std::uint32_t sum = wire::crc32c_value(crc);
    if (!flash_.read(slot, end, value) || low(value) != sum || high(value) != ~sum) return false;
    found = {.slot = slot, .sequence = low(order), .length = high(head)};
    return true;
  }

  Newest find() {
    Newest newest;
    for (std::uint32_t slot = 0; slot < kSlots; ++slot) {
      Newest here;
      if (!look(slot, here)) continue;
      const bool is_newer =
          newest.slot == kNone || static_cast<std::int32_t>(here.sequence - newest.sequence) > 0;
      if (is_newer) newest = here;
    }
    return newest;
  }

  Flash& flash_;
};

}  // namespace palpate::stm32g4
