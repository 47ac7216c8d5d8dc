// What a scene's local models cost the host, beside a fixed piece of work in the same run.
#pragma once

#include <cstdint>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host::bench {

struct ModelCost {
  double kernel_s = 0;  // median time of the reference kernel: a product of two 128 x 128 matrices of doubles
  double model_s = 0;   // median time of a model on a patch whose constants are known
  double first_s = 0;   // of the first model, with what is computed once for a body and a patch
};

// A state of the body, and where it is touched.
struct TouchedState {
  BodyState state;
  SurfacePoint contact;
};

// Builds a model of each state once, then `rounds` times, taking turns with the kernel. Throws
// std::invalid_argument without a state or a round, and what the builder throws.
ModelCost measure_model_cost(ModelBuilder& builder, const std::vector<TouchedState>& states,
                             std::uint32_t rounds);

}  // namespace palpate::host::bench
