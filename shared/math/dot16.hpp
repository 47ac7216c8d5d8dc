// Dot products of 16-bit integers, the inner loop of the map from modes to nodes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__ARM_FEATURE_DSP) && __ARM_FEATURE_DSP
#include <arm_acle.h>
#endif

namespace palpate {

// Of three rows of `count` entries, one behind the other, with b: b is loaded once. Exact: count * 2^30 stays
// far inside 64 bits for any array here. Two products per instruction where the processor has them (Cortex-M4
// SMLALD); integers are the same everywhere. No alignment needed.
inline std::array<std::int64_t, 3> dot16_rows(const std::int16_t* rows, const std::int16_t* b,
                                              std::size_t count) {
  std::int64_t x = 0, y = 0, z = 0;
  const std::int16_t* r0 = rows;
  const std::int16_t* r1 = rows + count;
  const std::int16_t* r2 = rows + 2 * count;
  const std::int16_t* const end = b + count;
#if defined(__ARM_FEATURE_DSP) && __ARM_FEATURE_DSP
  const auto pair = [](const std::int16_t* at) {
    int16x2_t value;
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  const auto add_pair = [&](std::size_t k) {
    const int16x2_t factor = pair(b + k);
    x = __smlald(pair(r0 + k), factor, x);
    y = __smlald(pair(r1 + k), factor, y);
    z = __smlald(pair(r2 + k), factor, z);
  };
  for (const std::int16_t* const last = b + count / 8 * 8; b != last; r0 += 8, r1 += 8, r2 += 8, b += 8) {
    add_pair(0);
    add_pair(2);
    add_pair(4);
    add_pair(6);
  }
#endif
  for (; b != end; ++r0, ++r1, ++r2, ++b) {
    const std::int32_t factor = *b;
    x += static_cast<std::int32_t>(*r0) * factor;
    y += static_cast<std::int32_t>(*r1) * factor;
    z += static_cast<std::int32_t>(*r2) * factor;
  }
  return {x, y, z};
}

}  // namespace palpate
