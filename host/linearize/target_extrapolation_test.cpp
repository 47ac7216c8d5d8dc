#include "host/linearize/target_extrapolation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shared/model/local_model.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host {
namespace {

struct Mode {
  double lambda_rad2_s2, damping_rad_s, weight;
};

// A model of one node that moves along one axis only.
LocalModel model_of(const std::vector<Mode>& modes) {
  LocalModel model;
  model.step_s = kTick_s;
  model.surface_nodes = 1;
  const auto count = static_cast<Eigen::Index>(modes.size());
  model.q = model.p = model.load = Eigen::VectorXd::Zero(count);
  model.lambda_rad2_s2.resize(count);
  model.damping_rad_s.resize(count);
  model.basis = Eigen::MatrixXd::Zero(3, count);
  for (Eigen::Index m = 0; m < count; ++m) {
    const Mode& mode = modes[static_cast<std::size_t>(m)];
    model.lambda_rad2_s2(m) = mode.lambda_rad2_s2;
    model.damping_rad_s(m) = mode.damping_rad_s;
    model.basis(2, m) = std::sqrt(mode.weight);
    model.coefficient.push_back(modal_coefficients(mode.lambda_rad2_s2, mode.damping_rad_s, kTick_s));
  }
  return model;
}

// Presses 1 um a tick into the node, with a force that meets the target in each tick, and returns by how many
// ticks that force is ahead of the continuous modes' mean of the tick, from their static answers and lags.
double lead_ticks(const LocalModel& model, double target) {
  constexpr int kTicks = 2000;
  constexpr double kATick_m = 1e-6;
  const Eigen::ArrayXd w = model.basis.row(2).array().square();
  const Eigen::ArrayXd lambda = model.lambda_rad2_s2.array(), d = model.damping_rad_s.array();
  Eigen::ArrayXd q = Eigen::ArrayXd::Zero(w.size()), p = q;
  double force_N = 0.0;
  for (int tick = 1; tick <= kTicks; ++tick) {
    double free_m = 0.0, pushed = 0.0;
    for (Eigen::Index m = 0; m < w.size(); ++m) {
      const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
      const double before = q(m);
      q(m) += c.a11 * before + c.a12 * p(m);
      p(m) += c.a21 * before + c.a22 * p(m);
      free_m += w(m) * (q(m) + 0.5 * kTick_s * p(m));
      pushed += w(m) * (c.b1 + 0.5 * kTick_s * c.b2);
    }
    force_N = ((tick + target) * kATick_m - free_m) / pushed;
    for (Eigen::Index m = 0; m < w.size(); ++m) {
      q(m) += model.coefficient[static_cast<std::size_t>(m)].b1 * force_N;
      p(m) += model.coefficient[static_cast<std::size_t>(m)].b2 * force_N;
    }
  }
  const double static_m_N = (w / lambda).sum(),
               lag_ticks = (w * d / lambda.square()).sum() / kTick_s / static_m_N;
  const double slope_N = kATick_m / static_m_N;
  return force_N / slope_N - (kTicks - 0.5) - lag_ticks;
}

// Slow, over within a tick, faster than can be sampled (backward Euler), overdamped.
const std::vector<std::vector<Mode>> kModels{{{1e4, 20.0, 0.5}},
                                             {{4e6, 1800.0, 200.0}},
                                             {{2e7, 500.0, 300.0}},
                                             {{9e6, 9000.0, 400.0}},
                                             {{1e4, 20.0, 0.5}, {4e6, 1800.0, 200.0}, {2e7, 500.0, 300.0}}};

TEST(TargetExtrapolation, ASteadyPressHasTheForceOfTheMeanOfTheTick) {
  for (const std::vector<Mode>& modes : kModels) {
    const LocalModel model = model_of(modes);
    const double e = centred_target_ticks(model);
    EXPECT_NEAR(lead_ticks(model, e), 0.0, 1e-6) << modes.front().lambda_rad2_s2;
    EXPECT_NEAR(lead_ticks(model, 0.5), 0.5 - e, 1e-6);  // what half a tick of motion does
  }
}

TEST(TargetExtrapolation, IsHalfATickForSlowModesAndMinusHalfForThoseThatAreOverWithinIt) {
  EXPECT_NEAR(centred_target_ticks(model_of({{100.0, 1.0, 1.0}})), 0.5, 1e-4);
  EXPECT_NEAR(centred_target_ticks(model_of({{1e12, 1e7, 1.0}})), -0.5, 0.02);
  EXPECT_EQ(centred_target_ticks(model_of({{100.0, 1.0, 1.0}, {-5.0, 1.0, 1.0}})), 0.5);
}

TEST(TargetExtrapolation, TheBasisHasItInSixteenthsBetweenNoneAndHalf) {
  EXPECT_EQ(target_below_half_16ths(model_of({{100.0, 1.0, 1.0}})), 0);
  EXPECT_EQ(target_below_half_16ths(model_of({{1e12, 1e7, 1.0}})), kMaxTargetBelowHalf_16ths);
  const LocalModel between = model_of({{1.2e6, 1200.0, 1.0}});
  const double e = centred_target_ticks(between);
  ASSERT_GT(e, 0.1);
  ASSERT_LT(e, 0.45);
  EXPECT_NEAR(0.5 - target_below_half_16ths(between) / 16.0, e, 1.0 / 32.0 + 1e-12);
}

}  // namespace
}  // namespace palpate::host
