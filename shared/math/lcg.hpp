// Random numbers that are the same on every machine: integers only.
#pragma once

#include <cstdint>

namespace palpate {

// Numerical Recipes' generator (Press et al., 3rd edition, section 7.1.4).
class Lcg {
 public:
  explicit Lcg(std::uint32_t seed) : state_(seed) {}
  // Uniform in 0 ... bound - 1.
  std::int32_t below(std::uint32_t bound) {
    state_ = state_ * 1664525u + 1013904223u;
    return static_cast<std::int32_t>((state_ >> 8) % bound);
  }
  // Uniform in [low, high), in 2^16 steps.
  float uniform(float low, float high) {
    constexpr std::uint32_t kSteps = 1u << 16;
    return low + (high - low) * (static_cast<float>(below(kSteps)) * (1.0f / static_cast<float>(kSteps)));
  }

 private:
  std::uint32_t state_;
};

}  // namespace palpate
