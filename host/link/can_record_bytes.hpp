// A frame of a CAN bus as the bytes of its record (shared/wire/can_record.hpp).
#pragma once

#include <cstdint>
#include <vector>

#include "shared/wire/can_record.hpp"

namespace palpate::link {

// Empty where the frame is none of CAN's.
inline std::vector<std::uint8_t> can_record_of(const wire::CanFrame& frame) {
  std::vector<std::uint8_t> record(frame.data.size() + wire::kCanRecordOverheadBytes);
  record.resize(wire::write_can_record(frame, record));
  return record;
}

}  // namespace palpate::link
