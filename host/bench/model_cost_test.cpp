#include "host/bench/model_cost.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "host/msd/lattice.hpp"

namespace palpate::host::bench {
namespace {

// Counts what is asked of it.
class Counting final : public ModelBuilder {
 public:
  LocalModel build(const BodyState& state, const SurfacePoint& contact, const std::vector<int>&) override {
    ++models;
    z_m = state.position_m(2, 0);
    triangle = contact.triangle;
    return {};
  }
  int models = 0, triangle = -1;
  double z_m = 0;
};

Body small_body() {
  LatticeSpec spec;
  spec.nodes = {2, 2, 2};
  spec.fixed_faces = {Face::z_minus};
  return make_lattice(spec);
}

TEST(ModelCost, builds_each_state_once_and_then_rounds_times) {
  const Body body = small_body();
  BodyState lifted = body.rest_state();
  lifted.position_m.row(2).array() += 0.5;
  Counting builder;
  const ModelCost cost =
      measure_model_cost(builder, {{body.rest_state(), {0, {1, 0, 0}}}, {lifted, {3, {1, 0, 0}}}}, 4);
  EXPECT_EQ(builder.models, 2 * (1 + 4));
  EXPECT_EQ(builder.triangle, 3);
  EXPECT_EQ(builder.z_m, lifted.position_m(2, 0));
  EXPECT_GT(cost.kernel_s, 0.0);
  EXPECT_GE(cost.model_s, 0.0);
  EXPECT_GE(cost.first_s, 0.0);
}

TEST(ModelCost, refuses_nothing_to_measure) {
  Counting builder;
  const Body body = small_body();
  EXPECT_THROW((void)measure_model_cost(builder, {}, 1), std::invalid_argument);
  EXPECT_THROW((void)measure_model_cost(builder, {{body.rest_state(), {}}}, 0), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host::bench
