#include "shared/wire/tip_trace.hpp"

#include <cmath>
#include <cstdint>

#include "palpate/ServoTrace_1_0.h"

namespace palpate::wire {
namespace {

constexpr int kLeastExponent = palpate_TipTrace_1_0_STEP_EXPONENT_LEAST;
constexpr int kMostExponent = palpate_TipTrace_1_0_STEP_EXPONENT_MOST;
constexpr float kLeastStep_m = 0x1p-36f;
static_assert(kLeastExponent == -36);
// 32767 steps and what is rounded to them lie below.
constexpr float kEnd_steps = 32767.5f;

static_assert(kMaxTraceTicks == palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_);

// The nearest whole number; of a half the one away from zero. There is no libm on the board.
std::int16_t rounded(float steps) {
  const auto whole = static_cast<std::int32_t>(steps);
  const float rest = steps - static_cast<float>(whole);  // exact
  const std::int32_t away = rest >= 0.5f ? 1 : (rest <= -0.5f ? -1 : 0);
  return static_cast<std::int16_t>(whole + away);
}

}  // namespace

Status write_tips(std::span<const Vec3f> tip_m, palpate_TipTrace_1_0& message) {
  const Vec3f& base_m = tip_m.front();
  float largest_m = 0.0f;
  for (const Vec3f& tip : tip_m) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float offset_m = std::fabs(tip[axis] - base_m[axis]);
      if (!std::isfinite(offset_m)) return Status::payload_malformed;
      if (offset_m > largest_m) largest_m = offset_m;
    }
  }
  // A float times a power of two is exact: what follows rounds once, to whole steps.
  int exponent = kLeastExponent;
  float step_m = kLeastStep_m;
  for (; largest_m >= kEnd_steps * step_m; ++exponent) {
    if (exponent == kMostExponent) return Status::payload_malformed;
    step_m *= 2.0f;
  }
  const float steps_per_m = 1.0f / step_m;
  message.step_exponent = static_cast<std::int8_t>(exponent);
  message.offsets.count = tip_m.size() - 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    message.tip_m[axis] = base_m[axis];
    for (std::size_t i = 1; i < tip_m.size(); ++i)
      message.offsets.elements[i - 1].steps[axis] = rounded((tip_m[i][axis] - base_m[axis]) * steps_per_m);
  }
  return Status::ok;
}

Status check_tips(const palpate_TipTrace_1_0& message) {
  for (const float coordinate_m : message.tip_m)
    if (!std::isfinite(coordinate_m)) return Status::payload_malformed;
  return message.step_exponent >= kLeastExponent && message.step_exponent <= kMostExponent
             ? Status::ok
             : Status::payload_malformed;
}

Vec3d read_tip(const palpate_TipTrace_1_0& message, std::size_t i) {
  Vec3d tip_m{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    tip_m[axis] = static_cast<double>(message.tip_m[axis]);
    if (i > 0)
      tip_m[axis] +=
          std::ldexp(static_cast<double>(message.offsets.elements[i - 1].steps[axis]), message.step_exponent);
  }
  return tip_m;
}

}  // namespace palpate::wire
