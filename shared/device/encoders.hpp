// Encoder counts to joint angles, and back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::device {

using EncoderCounts = std::array<std::int32_t, 3>;

// Joint angles, rad. reference: the counts that were read in the reference pose t = 0 (calibration). An
// encoder only knows the interval that its joint is in; the angle returned is the middle of it. Counters that
// wrapped around between reference and now are understood. Differences above 2^24 counts (2,000 rad) lose
// precision.
[[nodiscard]] inline Vec3f joint_angles(const Parameters& device, const EncoderCounts& count,
                                        const EncoderCounts& reference) {
  Vec3f joint_rad;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto difference = static_cast<std::int32_t>(static_cast<std::uint32_t>(count[i]) -
                                                      static_cast<std::uint32_t>(reference[i]));
    const float signed_counts =
        device.joint[i].encoder_sign < 0 ? -static_cast<float>(difference) : static_cast<float>(difference);
    joint_rad[i] = signed_counts / device.joint[i].counts_per_rad;
  }
  return joint_rad;
}

// What an ideal encoder reads at a joint angle, relative to the reference pose: the angle in counts, rounded
// down after shifting by half a count (the reference pose lies in the middle of interval 0, which makes
// joint_angles unbiased). Beyond the range of the counter, and for NaN: the counter's smallest or largest
// value.
template <class Real>
[[nodiscard]] constexpr std::int32_t encoder_count(const Joint& joint, Real joint_rad) {
  constexpr Real kSmallest = static_cast<Real>(std::numeric_limits<std::int32_t>::min());
  const Real scaled = joint_rad * static_cast<Real>(joint.counts_per_rad);
  const Real shifted = (joint.encoder_sign < 0 ? -scaled : scaled) + Real(0.5);
  if (!(shifted > kSmallest)) return std::numeric_limits<std::int32_t>::min();
  if (shifted >= -kSmallest) return std::numeric_limits<std::int32_t>::max();
  const auto truncated = static_cast<std::int32_t>(shifted);
  return static_cast<Real>(truncated) > shifted ? truncated - 1 : truncated;
}

}  // namespace palpate::device
