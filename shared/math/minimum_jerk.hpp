// The way of a movement from rest to rest with the least jerk.
#pragma once

namespace palpate {

// Share of the way that is done at share u in [0, 1] of the time: 10 u^3 - 15 u^4 + 6 u^5. Source: Flash and
// Hogan, The coordination of arm movements, J. Neuroscience 5(7), 1985.
template <class Real>
constexpr Real minimum_jerk(Real u) {
  return u * u * u * (Real(10) + u * (Real(-15) + u * Real(6)));
}

}  // namespace palpate
