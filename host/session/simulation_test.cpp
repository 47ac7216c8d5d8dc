#include "host/session/simulation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::Path;

// Rest lengths are rounded: springs at rest move nodes by the last bit of their position.
constexpr double kRest_m = 1e-16;

SimulationConfig config_for(const Path& path, double friction, double step_s) {
  SimulationConfig config;
  config.step_s = step_s;
  config.friction.elsewhere = {friction, friction};
  config.ticks = path.ticks();
  config.tip_m = path.tip_m;
  return config;
}

double rms_difference_N(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += dot(a[i] - b[i], a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

// The force over a press and a sideways movement, sticking or slipping, converges as the step shrinks: the
// order is that of semi-implicit Euler, 1 (measured: 1.000 to 1.022), by the differences of successive
// solutions.
class ForceConvergence : public ::testing::TestWithParam<double> {};

TEST_P(ForceConvergence, IsOfFirstOrder) {
  const Body body = block(4);
  Path path({0.0145, 0.0165, 5e-4});
  path.to({0.0145, 0.0165, -2e-3}, 60).to({0.0165, 0.0175, -2e-3}, 60);
  std::vector<std::vector<Vec3d>> force_N;
  for (const double step_s : {1e-4, 5e-5, 2.5e-5, 1.25e-5, 6.25e-6})
    force_N.push_back(
        simulate(body, body.rest_state(), config_for(path, GetParam(), step_s), {}).mean_force_N);
  const double size_N = rms_difference_N(force_N.back(), std::vector<Vec3d>(force_N.back().size()));
  ASSERT_GT(size_N, 0.1);
  std::vector<double> change;
  for (std::size_t i = 1; i < force_N.size(); ++i)
    change.push_back(rms_difference_N(force_N[i], force_N[i - 1]));
  for (std::size_t i = 1; i < change.size(); ++i) {
    const double order = std::log2(change[i - 1] / change[i]);
    EXPECT_NEAR(order, 1.0, 0.05) << "halving " << i;
  }
}
INSTANTIATE_TEST_SUITE_P(Friction, ForceConvergence, ::testing::Values(0.0, 0.3, 10.0));

TEST(Simulate, ExportsAndPeakAreStatesOfTheRun) {
  const Body body = block(4);
  Path path({0.0145, 0.0165, 5e-4});
  path.to({0.0145, 0.0165, -2e-3}, 30).to({0.0145, 0.0165, 5e-4}, 30);
  SimulationConfig config = config_for(path, 0.5, 1e-4);
  config.export_ticks = {0, 20, 60};
  const SimulationResult run = simulate(body, body.rest_state(), config, {});
  ASSERT_EQ(run.mean_force_N.size(), 60u);
  ASSERT_EQ(run.mode.size(), 60u);
  ASSERT_EQ(run.normal.size(), 60u);
  ASSERT_EQ(run.exported.size(), 3u);
  EXPECT_EQ(run.exported[0].position_m, body.rest_position_m());
  // A run that ends at tick 20 ends in the state exported there.
  Path start = path;
  start.tip_m.resize(21);
  config = config_for(start, 0.5, 1e-4);
  config.export_ticks = {20};
  EXPECT_EQ(simulate(body, body.rest_state(), config, {}).exported.at(0).position_m,
            run.exported[1].position_m);
  std::size_t peak = 0;
  for (std::size_t i = 0; i < run.mean_force_N.size(); ++i)
    if (norm(run.mean_force_N[i]) > norm(run.mean_force_N[peak])) peak = i;
  EXPECT_EQ(run.peak_tick, peak + 1);
}

TEST(Simulate, WithoutATipTheBodyStaysAtRest) {
  const Body body = block(4);
  for (const Method method : {Method::semi_implicit_euler, Method::implicit_euler, Method::sdirk2}) {
    SimulationConfig config;
    config.method = method;
    config.ticks = 10;
    const SimulationResult run = simulate(body, body.rest_state(), config, {});
    EXPECT_LE((run.state_at_peak.position_m - body.rest_position_m()).cwiseAbs().maxCoeff(), kRest_m);
    EXPECT_TRUE(run.mean_force_N.empty());
  }
}

TEST(Simulate, RefusesWhatDoesNotFitTogether) {
  const Body body = block(4);
  Path path({0.0145, 0.0165, 5e-4});
  path.hold(10);
  const auto refused = [&](auto change) {
    SimulationConfig config = config_for(path, 0.5, 1e-4);
    change(config);
    return test::message_of<std::invalid_argument>(
        [&] { (void)simulate(body, body.rest_state(), config, {}); });
  };
  EXPECT_NE(refused([](auto& c) { c.ticks = 9; }), "");
  EXPECT_NE(refused([](auto& c) { c.method = Method::sdirk2; }), "");
  EXPECT_NE(refused([](auto& c) { c.export_ticks = {11}; }), "");
  EXPECT_NE(refused([](auto& c) { c.export_ticks = {3, 3}; }), "");
  EXPECT_NE(refused([](auto& c) { c.step_s = 3e-5; }), "");
  EXPECT_NE(refused([](auto& c) { c.step_s = 1e-3; }), "");
  EXPECT_EQ(refused([](auto&) {}), "");
}

TEST(Simulate, StopsWhenToldTo) {
  const Body body = block(4);
  Path path({0.0145, 0.0165, 5e-4});
  path.hold(100);
  std::uint32_t calls = 0;
  const auto progress = [&](std::uint32_t, std::uint32_t of) {
    EXPECT_EQ(of, 100u);
    return ++calls < 3;
  };
  EXPECT_EQ(test::message_of<std::runtime_error>(
                [&] { (void)simulate(body, body.rest_state(), config_for(path, 0.5, 1e-4), progress); }),
            "stopped");
  EXPECT_EQ(calls, 3u);
}

}  // namespace
}  // namespace palpate::host
