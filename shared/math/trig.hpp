// Sine and cosine in single precision with our own polynomials: libm differs between platforms, these bits do
// not.
#pragma once

namespace palpate {

struct SinCos {
  float sine, cosine;
};

// Sine and cosine of angle_rad, |angle_rad| <= kSinCosRange_rad (beyond: both NaN).
// Cody-Waite reduction to [-pi/4, pi/4] and minimax polynomials; absolute error at most 1.2e-7 (tested).
inline constexpr float kSinCosRange_rad = 100.0f;
SinCos sin_cos(float angle_rad);

}  // namespace palpate
