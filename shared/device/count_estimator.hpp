// Where a joint is between two encoder counts, and how fast it moves, from the counts alone.
//
// Two stages. The tracker goes on at the velocity that it has learnt and is held inside the interval that the
// count stands for: a count that toggles does not move it, and in motion it crosses from one interval to the
// next when the joint does. The velocity learns from counts that follow each other in one direction (the miss
// at the new count over the ticks since the last one); one that turns back sets it to zero. The output
// follows the tracker with the same velocity: slowly at rest, so that a count that comes after a long time
// does not click, without delay in motion. Related: first-order adaptive windowing (Janabi-Sharifi, Hayward,
// Chen, IEEE Trans. Control Systems Technology 8(6), 2000), which likewise takes the longest time that one
// velocity explains; compared in docs/decisions/coupling.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/device/arm.hpp"
#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::device {

// Share of a miss that the velocity takes up at each count.
inline constexpr float kVelocityGain = 0.5f;
// A count that follows another one this late or later says nothing about the velocity.
inline constexpr float kLongestInterval_ticks = 128.0f;
// Share of its distance to the tracker that the output closes per tick: this at rest, and |velocity| times
// the other more.
inline constexpr float kRestGain = 1.0f / 32.0f;
inline constexpr float kMotionGain_ticks = 4.0f;
// The output is held this close to the count.
inline constexpr float kFarthest_count = 2.0f;
// More than this in a tick (30 m/s at the tip) is no motion: the estimate starts anew.
inline constexpr float kLargestStep_count = 1000.0f;

// One joint. All positions are relative to the count, in counts. The joint itself is within half a count of
// its count, so the tracker is within one count of it, and the output within two and a half; within one again
// when the joint has come to rest.
class CountEstimator {
 public:
  // Interrupt context, once per servo tick: the count's change since the last call, and the ticks since then.
  void update(float change_count, float elapsed_ticks) {
    if (!(change_count <= kLargestStep_count && change_count >= -kLargestStep_count)) {
      *this = {};
      return;
    }
    const float travel = velocity_ * elapsed_ticks;
    const float ahead = tracked_ + travel - change_count;
    tracked_ = ahead > 0.5f ? 0.5f : (ahead < -0.5f ? -0.5f : ahead);
    const float miss = tracked_ - ahead;
    since_count_ += elapsed_ticks;
    if (since_count_ > kLongestInterval_ticks) since_count_ = kLongestInterval_ticks;
    if (change_count != 0.0f) {
      const std::int8_t direction = change_count > 0.0f ? 1 : -1;
      const bool goes_on = direction == direction_ && since_count_ < kLongestInterval_ticks;
      velocity_ = goes_on ? velocity_ + kVelocityGain * miss / since_count_ : 0.0f;
      direction_ = direction;
      since_count_ = 0.0f;
    } else {
      velocity_ += kVelocityGain * miss;  // the count that it expected has not come
    }

    const float speed = velocity_ < 0.0f ? -velocity_ : velocity_;
    float gain = (kRestGain + kMotionGain_ticks * speed) * elapsed_ticks;
    if (gain > 1.0f) gain = 1.0f;
    offset_ += velocity_ * elapsed_ticks - change_count;
    offset_ += gain * (tracked_ - offset_);
    if (offset_ > kFarthest_count) offset_ = kFarthest_count;
    if (offset_ < -kFarthest_count) offset_ = -kFarthest_count;
  }

  // Estimated position less the count.
  [[nodiscard]] float offset_count() const { return offset_; }
  // Counts per tick.
  [[nodiscard]] float velocity_count_tick() const { return velocity_; }

 private:
  float tracked_ = 0.0f;  // within [-1/2, 1/2]
  float offset_ = 0.0f;
  float velocity_ = 0.0f;
  float since_count_ = kLongestInterval_ticks;
  std::int8_t direction_ = 0;  // of the last change
};

using CountEstimators = std::array<CountEstimator, 3>;

// Tip between the counts, device frame; `pose` is that of the counts. To first order in the at most 2 counts
// (0.3 mrad), which leaves out some 10 nm.
[[nodiscard]] inline Vec3f estimated_tip(const Parameters& device, const Pose& pose,
                                         const CountEstimators& estimators) {
  Vec3f offset_rad{};
  for (std::size_t i = 0; i < 3; ++i) {
    const float offset = estimators[i].offset_count() / device.joint[i].counts_per_rad;
    offset_rad[i] = device.joint[i].encoder_sign < 0 ? -offset : offset;
  }
  return pose.tip_m + pose.jacobian_m * offset_rad;
}

// Velocities of the joints, rad/s.
[[nodiscard]] inline Vec3f estimated_joint_velocity(const Parameters& device,
                                                    const CountEstimators& estimators) {
  constexpr float kTicks_1_s = 1000.0f;
  Vec3f velocity_rad_s{};
  for (std::size_t i = 0; i < 3; ++i) {
    const float velocity = estimators[i].velocity_count_tick() * kTicks_1_s / device.joint[i].counts_per_rad;
    velocity_rad_s[i] = device.joint[i].encoder_sign < 0 ? -velocity : velocity;
  }
  return velocity_rad_s;
}

// Velocity of the tip, device frame, m/s.
[[nodiscard]] inline Vec3f estimated_velocity(const Parameters& device, const Pose& pose,
                                              const CountEstimators& estimators) {
  return pose.jacobian_m * estimated_joint_velocity(device, estimators);
}

}  // namespace palpate::device
