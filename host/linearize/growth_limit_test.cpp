#include "host/linearize/growth_limit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "host/linearize/patch_builder.hpp"
#include "host/linearize/pressed_state.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kTick_s = 1e-3, kStep_s = 1e-4;
constexpr int kTicks = 200;
constexpr double kTime_s = kTicks * kTick_s;

void step(LocalModel& model) {
  for (Eigen::Index m = 0; m < model.modes(); ++m) {
    const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
    const double q = model.q[m], p = model.p[m], u = model.load[m];
    model.q[m] += c.a11 * q + c.a12 * p + c.b1 * u;
    model.p[m] += c.a21 * q + c.a22 * p + c.b2 * u;
  }
}

TEST(GrowthLimit, LetsAModeGrowTenfoldAndNoMore) {
  for (const double damping_rad_s : {0.0, 5.0, 400.0}) {
    const double least = least_lambda_rad2_s2(damping_rad_s, kTime_s);
    const double growth_1_s = 0.5 * (std::sqrt(damping_rad_s * damping_rad_s - 4.0 * least) - damping_rad_s);
    EXPECT_NEAR(std::exp(growth_1_s * kTime_s), kLargestGrowth, 1e-9 * kLargestGrowth);
  }
}

// 12 mm in cells of 10 mm: the node has passed those below it. Held there the body rests; let go, it does
// not.
class Compressed : public testing::Test {
 protected:
  Body body_ = make_lattice(test::reference_spec(8));
  int node_ = body_.lattice()->node(4, 4, 7);
  BodyState state_ = pressed_state(body_, node_, {0.0, 0.0, -0.012}, kStep_s);
  SurfacePoint contact_ =
      nearest_surface_point(body_, body_.rest_position_m(), body_.rest_position_m().col(node_));
  LocalModel model_ = build_patch(body_, state_, contact_, {4, 4, 2}, kTick_s);
};

TEST_F(Compressed, GrowingModesAreLimitedAndCounted) {
  const double damping_rad_s = model_.damping_rad_s[0];
  ASSERT_LT(model_.lambda_rad2_s2[0], 2.0 * least_lambda_rad2_s2(damping_rad_s, kTime_s));
  LocalModel limited = model_;
  limit_growth(limited, kTime_s);
  EXPECT_GE(limited.limited_modes, 1);
  for (Eigen::Index m = 0; m < model_.modes(); ++m) {
    const bool raised = limited.lambda_rad2_s2[m] != model_.lambda_rad2_s2[m];
    EXPECT_EQ(raised, model_.lambda_rad2_s2[m] < least_lambda_rad2_s2(model_.damping_rad_s[m], kTime_s));
  }
  // Each mode alone, from a deviation at rest.
  const auto growth = [](LocalModel model) {
    model.q.setOnes();
    model.p.setZero();
    model.load.setZero();
    for (int tick = 0; tick < kTicks; ++tick) step(model);
    return model.q.cwiseAbs().maxCoeff();
  };
  EXPECT_LE(growth(limited), kLargestGrowth);
  EXPECT_GT(growth(model_), 100.0 * kLargestGrowth);
}

TEST_F(Compressed, LetGoTheLimitedModelStaysNearTheBodyAndTheOtherDoesNot) {
  LocalModel limited = model_, free = model_;
  limit_growth(limited, kTime_s);
  SemiImplicitEuler integrator(body_);
  BodyState state = state_;
  double body_m = 0, limited_m = 0, free_m = 0;
  for (int tick = 0; tick < kTicks; ++tick) {
    for (int i = 0; i < 10; ++i) integrator.step(state, {}, kStep_s);
    step(limited);
    step(free);
    body_m = std::max(body_m, (state.position_m - state_.position_m).colwise().norm().maxCoeff());
    limited_m = std::max(limited_m, (limited.basis * limited.q).cwiseAbs().maxCoeff());
    free_m = std::max(free_m, (free.basis * free.q).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(body_m, 0.02);  // it comes back to rest
  EXPECT_GT(free_m, 1.0);
  EXPECT_LT(limited_m, 0.1);  // 5 cm in 200 ms with nothing that corrects it
}

TEST(GrowthLimit, LeavesAStableModelAsItIs) {
  const Body body = make_lattice(test::reference_spec(6));
  const SurfacePoint contact =
      nearest_surface_point(body, body.rest_position_m(), Eigen::Vector3d(0.025, 0.025, 1.0));
  LocalModel model = build_patch(body, body.rest_state(), contact, {4, 4, 2}, kTick_s);
  const Eigen::VectorXd before = model.lambda_rad2_s2;
  limit_growth(model, kTime_s);
  EXPECT_EQ(model.limited_modes, 0);
  EXPECT_EQ(model.lambda_rad2_s2, before);
}

}  // namespace
}  // namespace palpate::host
