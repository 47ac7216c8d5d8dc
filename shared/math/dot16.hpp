// Dot product of 16-bit integers, the inner loop of the map from modes to nodes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__ARM_FEATURE_DSP) && __ARM_FEATURE_DSP
#include <arm_acle.h>
#endif

namespace palpate {

// Exact: count * 2^30 stays far inside 64 bits for any array here. Two products per instruction where the
// processor has them (Cortex-M4 SMLALD); integers are the same everywhere. No alignment needed.
inline std::int64_t dot16(const std::int16_t* a, const std::int16_t* b, std::size_t count) {
  std::int64_t sum = 0;
  std::size_t i = 0;
#if defined(__ARM_FEATURE_DSP) && __ARM_FEATURE_DSP
  const auto pair = [](const std::int16_t* at) {
    int16x2_t value;
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  for (; i + 8 <= count; i += 8, a += 8, b += 8) {
    sum = __smlald(pair(a), pair(b), sum);
    sum = __smlald(pair(a + 2), pair(b + 2), sum);
    sum = __smlald(pair(a + 4), pair(b + 4), sum);
    sum = __smlald(pair(a + 6), pair(b + 6), sum);
  }
  for (; i < count; ++i) sum += static_cast<std::int32_t>(*a++) * static_cast<std::int32_t>(*b++);
  return sum;
#else
  for (; i < count; ++i) sum += static_cast<std::int32_t>(a[i]) * static_cast<std::int32_t>(b[i]);
  return sum;
#endif
}

}  // namespace palpate
