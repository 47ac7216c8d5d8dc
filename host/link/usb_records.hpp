// The far end of boards/lockstep/usb_record.hpp: tokens for the board, and what it answers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "boards/lockstep/usb_record.hpp"

namespace palpate::link {

using lockstep::UsbRecord;

struct UsbAnswer {
  UsbRecord kind = UsbRecord::silence;
  std::uint8_t address = 0;
  std::vector<std::uint8_t> data;
};

void append_usb_record(std::vector<std::uint8_t>& records, UsbRecord kind, std::uint8_t address = 0,
                       std::span<const std::uint8_t> data = {});

// Cuts what the board sends into records, wherever its bytes are cut.
class UsbAnswerReader {
 public:
  void feed(std::span<const std::uint8_t> bytes);
  // The next whole one. Throws std::runtime_error for bytes that are none of the board's.
  std::optional<UsbAnswer> next();
  // Of a board that has started again: the rest of a record does not come.
  void forget() { waiting_.clear(); }

 private:
  std::vector<std::uint8_t> waiting_;
};

}  // namespace palpate::link
