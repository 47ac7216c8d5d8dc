#include "shared/math/trig.hpp"

#include <cstdint>
#include <limits>

namespace palpate {

SinCos sin_cos(float angle_rad) {
  if (!(angle_rad >= -kSinCosRange_rad && angle_rad <= kSinCosRange_rad)) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    return {nan, nan};
  }
  // pi/2 split in three parts with few enough bits that quadrant * part is exact for the range above.
  constexpr float kTwoOverPi = 0.636619772f;
  constexpr float kHalfPi1 = 1.5703125f, kHalfPi2 = 4.837512969970703125e-4f,
                  kHalfPi3 = 7.549789948768648e-8f;
  const float scaled = angle_rad * kTwoOverPi;
  const auto quadrant = static_cast<std::int32_t>(scaled + (scaled >= 0.0f ? 0.5f : -0.5f));
  const float count = static_cast<float>(quadrant);
  const float r = ((angle_rad - count * kHalfPi1) - count * kHalfPi2) - count * kHalfPi3;
  const float s = r * r;
  // Minimax polynomials on [-pi/4, pi/4] (Cephes sinf/cosf coefficients).
  const float sine = r + r * s * (-1.6666654611e-1f + s * (8.3321608736e-3f + s * -1.9515295891e-4f));
  const float cosine =
      1.0f - 0.5f * s +
      s * s * (4.166664568298827e-2f + s * (-1.388731625493765e-3f + s * 2.443315711809948e-5f));
  switch (static_cast<std::uint32_t>(quadrant) & 3u) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

}  // namespace palpate
