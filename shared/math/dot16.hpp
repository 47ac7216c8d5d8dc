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

// A row of a matrix, and the factor of all its entries.
struct Row16 {
  std::uint16_t row = 0;
  std::int16_t factor = 0;
};

// Calls take(c, sum over rows of matrix[row][c] * factor) for all columns of the matrix, which is stored row
// by row. Exact as long as the magnitudes of the factors add up to at most 65,535.
template <class Take>
inline void dot16_columns(const std::int16_t* matrix, std::size_t columns, const Row16* rows,
                          std::size_t count, Take&& take) {
  const Row16* const end = rows + count;
  std::size_t c = 0;
#if defined(__ARM_FEATURE_DSP) && __ARM_FEATURE_DSP
  // Eight columns at a time: their sums stay in registers.
  for (; c + 8 <= columns; c += 8) {
    std::int32_t x0 = 0, x1 = 0, x2 = 0, x3 = 0, x4 = 0, x5 = 0, x6 = 0, x7 = 0;
    for (const Row16* row = rows; row != end; ++row) {
      const std::int16_t* entry = matrix + row->row * columns + c;
      const std::int32_t factor = row->factor;
      std::int32_t two;
      std::memcpy(&two, entry, sizeof two);
      x0 = __smlabb(two, factor, x0);
      x1 = __smlatb(two, factor, x1);
      std::memcpy(&two, entry + 2, sizeof two);
      x2 = __smlabb(two, factor, x2);
      x3 = __smlatb(two, factor, x3);
      std::memcpy(&two, entry + 4, sizeof two);
      x4 = __smlabb(two, factor, x4);
      x5 = __smlatb(two, factor, x5);
      std::memcpy(&two, entry + 6, sizeof two);
      x6 = __smlabb(two, factor, x6);
      x7 = __smlatb(two, factor, x7);
    }
    take(c, x0);
    take(c + 1, x1);
    take(c + 2, x2);
    take(c + 3, x3);
    take(c + 4, x4);
    take(c + 5, x5);
    take(c + 6, x6);
    take(c + 7, x7);
  }
#endif
  for (; c < columns; ++c) {
    std::int32_t sum = 0;
    for (const Row16* row = rows; row != end; ++row)
      sum +=
          static_cast<std::int32_t>(matrix[row->row * columns + c]) * static_cast<std::int32_t>(row->factor);
    take(c, sum);
  }
}

}  // namespace palpate
