// The tip's path in a palpate.TipTrace: single precision to steps of 16 bits (the message says how), and
// back.
#pragma once

#include <cstddef>
#include <span>

#include "palpate/TipTrace_1_0.h"
#include "shared/math/linear.hpp"
#include "shared/status.hpp"

namespace palpate::wire {

// Ticks in the longest message, of either form of trace.
inline constexpr std::size_t kMaxTraceTicks = 1 + palpate_TipTrace_1_0_offsets_ARRAY_CAPACITY_;

// What a coordinate is off by, in steps of the message, is less than this.
inline constexpr double kTipError_steps = 0.502;

// tip_m: 1 to kMaxTraceTicks positions in the device frame. Sets all of `message` but first_tick. Anything
// but Status::ok: a position is not finite, or the tip went further than the message can say; `message` holds
// no usable value then. Any context.
Status write_tips(std::span<const Vec3f> tip_m, palpate_TipTrace_1_0& message);

// Can the message be read? Status::payload_malformed where the first position is not finite or the exponent
// is none that a message may have. Any context.
Status check_tips(const palpate_TipTrace_1_0& message);

// Position `i` ticks after first_tick, m; i up to the number of offsets. Host.
Vec3d read_tip(const palpate_TipTrace_1_0& message, std::size_t i);

}  // namespace palpate::wire
