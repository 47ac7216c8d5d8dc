// The full body that follows the compact trace against the one that follows the full trace.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "host/msd/vectors.hpp"
#include "host/session/session.hpp"
#include "host/session/simulation.hpp"
#include "host/session/test_contact.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::Path;

// How much the force of the tip can differ where each of its positions is off by 1 m at most, N/m.
//
// Held at a triangle the contact point has at most the stiffness k, damping b and mass m of its three nodes
// in a body that stays where it is: 3 x 17 springs (the most of a surface node) and 3 x 1 g; where the nodes
// around yield with it, a spring is stretched by twice as much. Two positions a tick T apart are off by 2,
// which is a speed of 2 / T, its change at a tick 4 / T, and that happens in the first step of a tick:
// averaged over the tick a force of 4 m / T^2. A slipping tip has friction times the difference of the normal
// force on top of that.
double sensitivity_N_m(const LatticeSpec& spec) {
  constexpr int kSprings = 3 * 17;
  const double k_N_m = kSprings * spec.stiffness_N_m, b_N_s_m = kSprings * spec.damping_N_s_m;
  const double m_kg = 3.0 * spec.mass_kg;
  return 2.0 * (k_N_m + b_N_s_m * 2.0 / kTick_s) + 4.0 * m_kg / (kTick_s * kTick_s);
}

constexpr double kGrip = 8.0;  // hardly ever slips
double slip_friction(double friction) {
  return friction < kGrip ? friction : 0.0;
}

struct Sent {
  std::vector<palpate_ServoTrace_1_0> full;
  std::vector<palpate_TipTrace_1_0> tips;
  std::vector<Vec3d> full_m, tips_m;  // positions as they arrive
  double largest_error_m = 0;         // as the messages bound it, of a position
};

Sent send(const Path& path, std::size_t ticks) {
  Sent sent;
  for (std::size_t first = 0; first < path.tip_m.size(); first += ticks) {
    std::vector<Vec3f> tip_m;
    for (std::size_t i = first; i < std::min(first + ticks, path.tip_m.size()); ++i) {
      const Vec3d& p = path.tip_m[i];
      tip_m.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    }
    palpate_ServoTrace_1_0& full = sent.full.emplace_back();
    full.first_tick = static_cast<std::uint32_t>(first);
    full.samples.count = tip_m.size();
    palpate_TipTrace_1_0& tips = sent.tips.emplace_back();
    EXPECT_EQ(wire::write_tips(tip_m, tips), Status::ok);
    tips.first_tick = full.first_tick;
    const double step_m = std::ldexp(1.0, tips.step_exponent);
    sent.largest_error_m = std::max(sent.largest_error_m, std::sqrt(3.0) * wire::kTipError_steps * step_m);
    for (std::size_t i = 0; i < tip_m.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) full.samples.elements[i].tip_m[axis] = tip_m[i][axis];
      sent.full_m.push_back({static_cast<double>(tip_m[i].x), static_cast<double>(tip_m[i].y),
                             static_cast<double>(tip_m[i].z)});
      sent.tips_m.push_back(wire::read_tip(tips, i));
    }
  }
  return sent;
}

class TipTraceSession : public ::testing::TestWithParam<std::tuple<double, std::size_t>> {
 protected:
  TipTraceSession() { path_.to({0.0145, 0.0165, -3e-3}, 80).to({0.0345, 0.0265, -3e-3}, 159); }
  Body body_ = block(6);
  Path path_{{0.0145, 0.0165, 5e-4}};
};

TEST_P(TipTraceSession, GivesTheSameForceWithinTheBound) {
  const auto [friction, ticks] = GetParam();
  const Sent sent = send(path_, ticks);
  const double bound_N =
      sensitivity_N_m(test::reference_spec(6)) * (1.0 + slip_friction(friction)) * sent.largest_error_m;
  EXPECT_LT(bound_N, 0.01);  // of forces of some newtons

  SimulationConfig config;
  config.friction.elsewhere = {friction, friction};
  config.ticks = path_.ticks();
  config.tip_m = sent.full_m;
  const SimulationResult full = simulate(body_, body_.rest_state(), config, {});
  config.tip_m = sent.tips_m;
  const SimulationResult tips = simulate(body_, body_.rest_state(), config, {});
  double largest_N = 0, force_N = 0;
  for (std::size_t i = 0; i < full.mean_force_N.size(); ++i) {
    largest_N = std::max(largest_N, norm(full.mean_force_N[i] - tips.mean_force_N[i]));
    force_N = std::max(force_N, norm(full.mean_force_N[i]));
  }
  const auto slip = std::count(full.mode.begin(), full.mode.end(), ContactMode::slip);
  const auto stick = std::count(full.mode.begin(), full.mode.end(), ContactMode::stick);
  EXPECT_EQ(stick > slip, friction == kGrip);
  EXPECT_GT(force_N, 0.5);
  EXPECT_GT(largest_N, 0.0);  // it is not the same path
  EXPECT_LT(largest_N, bound_N);
  RecordProperty("largest_uN", std::to_string(1e6 * largest_N));
  RecordProperty("bound_uN", std::to_string(1e6 * bound_N));
}

// Through the session: models of the same ticks from the same messages, the same contact, and the same state
// as of a simulation along the path that arrived.
TEST_P(TipTraceSession, ASessionFollowsIt) {
  const auto [friction, ticks] = GetParam();
  const Sent sent = send(path_, ticks);
  SessionConfig config;
  config.friction.elsewhere = {friction, friction};
  Session by_full(body_, body_.rest_state(), config), by_tips(body_, body_.rest_state(), config);
  int models = 0;
  for (std::size_t i = 0; i < sent.full.size(); ++i) {
    by_full.take(sent.full[i]);
    by_tips.take(sent.tips[i]);
    if (i % 4 != 3) continue;
    const auto full = by_full.update();
    const auto tips = by_tips.update();
    ASSERT_EQ(full.has_value(), tips.has_value());
    if (!tips) continue;
    ++models;
    EXPECT_EQ(full->message.tick, tips->message.tick);
    SimulationConfig simulation;
    simulation.friction = config.friction;
    simulation.ticks = tips->message.tick;
    simulation.tip_m.assign(sent.tips_m.begin(), sent.tips_m.begin() + simulation.ticks + 1);
    simulation.export_ticks = {simulation.ticks};
    EXPECT_EQ(tips->state.position_m,
              simulate(body_, body_.rest_state(), simulation, {}).exported.at(0).position_m);
  }
  EXPECT_GT(models, 5);
  EXPECT_TRUE(by_tips.missing().empty());
}

class TipTraceGap : public TipTraceSession {};

// A message that is missing shows as a gap of its ticks, whatever the form.
TEST_F(TipTraceGap, AGapIsAskedForWhicheverFormItsNeighboursHave) {
  const Sent sent = send(path_, 8);
  Session session(body_, body_.rest_state(), {});
  session.take(sent.full[0]);
  session.take(sent.tips[2]);
  ASSERT_EQ(session.missing().size(), 1u);
  EXPECT_EQ(session.missing()[0].first, 8u);
  EXPECT_EQ(session.missing()[0].count, 8u);
  session.take(sent.tips[1]);
  EXPECT_TRUE(session.missing().empty());
}

// Stick, slide, and both.
INSTANTIATE_TEST_SUITE_P(Tips, TipTraceSession,
                         ::testing::Combine(::testing::Values(kGrip, 0.0, 0.5),
                                            ::testing::Values(std::size_t{4}, std::size_t{8})));

}  // namespace
}  // namespace palpate::host
