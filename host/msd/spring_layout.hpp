// Springs sorted for fast evaluation: bands that the vector kernels handle, and the rest one by one.
#pragma once

#include <cstddef>
#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/spring_kernels.hpp"

namespace palpate::host {

struct SpringBand {
  std::ptrdiff_t first = 0;
  std::ptrdiff_t offset = 0;
  Spring constants{};  // of every spring in the band; its nodes have no meaning
  std::vector<double> present;

  [[nodiscard]] BandView view() const {
    return {first,
            static_cast<std::ptrdiff_t>(present.size()),
            offset,
            present.data(),
            constants.stiffness_N_m,
            constants.damping_N_s_m,
            constants.rest_length_m};
  }
};

struct SpringLayout {
  std::vector<SpringBand> bands;
  std::vector<Spring> loose;
};

// Groups springs of equal constants and equal node distance j - i. A group becomes a band where enough of it
// is present to pay for the places where it is not.
SpringLayout make_spring_layout(const Body& body);

}  // namespace palpate::host
