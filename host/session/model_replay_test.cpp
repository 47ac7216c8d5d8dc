#include "host/session/model_replay.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "host/linearize/patch_builder.hpp"
#include "host/session/model_message.hpp"
#include "host/session/node_probe.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::message_of;

constexpr Vec3f kFar_m{0.0175f, 0.0215f, 0.019f};

class ModelReplayTest : public ::testing::Test {
 protected:
  ModelReplayTest() {
    wire::ModelContents contents;
    pack_model(model_, {7, kTick, 200}, {}, SurfaceKind::smooth, SurfaceFriction(body_, {}), {}, contents);
    packed_ = wire::pack(contents);
  }
  static constexpr std::uint32_t kTick = 1000;
  Body body_ = block(5);
  BodyState state_ = test::random_state(body_, 1, 5e-4, 0.02);
  LocalModel model_ = build_patch(
      body_, state_, nearest_surface_point(body_, state_.position_m, {0.0175, 0.0215, 0.0}), {}, kTick_s);
  wire::PackedModel packed_;
};

TEST_F(ModelReplayTest, MovesTheNodesAsTheModelDoes) {
  // The basis is rounded to 1.5e-5 of a mode's largest entry, positions to single precision; the state to
  // half a step for each mode (shared/wire/model_state.hpp), and within 40 ticks the error of a velocity
  // moves a node by no more than 40 ms of it, that of a load by no more than it does at rest, and half as
  // much again.
  const auto modes = static_cast<double>(model_.modes());
  const double kRounding_m = 1e-7 + 0.5 * modes *
                                        (1.5 * static_cast<double>(packed_.state.load_step_m) +
                                         0.04 * static_cast<double>(packed_.state.p_step_m_s));
  ModelReplay replay(packed_, kFar_m);
  Eigen::VectorXd q = model_.q, p = model_.p;
  for (int tick = 0; tick <= 40; ++tick) {
    const Eigen::VectorXd moved = model_.basis * q;
    for (std::size_t n = 0; n < model_.node.size(); ++n) {
      const auto column = static_cast<Eigen::Index>(n);
      const Eigen::Vector3d expected =
          model_.origin_m + model_.position_m.col(column) + moved.segment<3>(3 * column);
      EXPECT_LE((replay.surface_node_m(n) - expected).norm(), kRounding_m) << tick;
      if (tick == 0) {
        EXPECT_LE((expected - state_.position_m.col(model_.node[n])).norm(), 1e-15);
      }
    }
    EXPECT_EQ(replay.step(kFar_m).force_N, Vec3f{});
    for (Eigen::Index m = 0; m < q.size(); ++m) {
      const ModalCoefficients& c = model_.coefficient[static_cast<std::size_t>(m)];
      const double old_q = q[m], old_p = p[m], u = model_.load[m];
      q[m] += c.a11 * old_q + c.a12 * old_p + c.b1 * u;
      p[m] += c.a21 * old_q + c.a22 * old_p + c.b2 * u;
    }
  }
}

TEST_F(ModelReplayTest, RefusesWhatTheBoardRefuses) {
  packed_.state.valid_ticks = 0;
  const auto refusal = [&] {
    return message_of<std::invalid_argument>([&] { ModelReplay(packed_, kFar_m); });
  };
  EXPECT_NE(refusal().find("local model 7: the board would refuse it"), std::string::npos);
  packed_.state.valid_ticks = 200;
  EXPECT_EQ(refusal(), "");
  packed_.state.load_step_m = std::nanf("");
  EXPECT_NE(refusal(), "");
}

TEST_F(ModelReplayTest, AProbeKnowsWhereTheModelWasActive) {
  const SentModel sent{packed_, model_.node};
  std::vector<RenderedTick> ticks;
  for (std::uint32_t tick = kTick - 5; tick < kTick + 30; ++tick) {
    if (tick == kTick + 4 || tick == kTick + 15) continue;  // lost
    ticks.push_back({tick, kFar_m, tick < kTick + 10 ? 0u : (tick < kTick + 20 ? 7u : 8u)});
  }
  // Lost before the take-over, the tick is replayed all the same; lost afterwards, it is not stepped.
  ModelReplay reference(packed_, kFar_m);
  for (int tick = 1; tick < 10; ++tick) (void)reference.step(kFar_m);
  const auto probed =
      replay_models(ticks, std::vector<SentModel>{sent}, model_.node[5], firmware::kCatchUpCortexM4).ticks;
  ASSERT_EQ(probed.size(), ticks.size());
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    if (ticks[i].model_sequence != 7) {
      EXPECT_TRUE(std::isnan(probed[i].node_m.x)) << ticks[i].tick;
      continue;
    }
    (void)reference.step(kFar_m);
    const Eigen::Vector3d expected = reference.surface_node_m(5);
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_EQ(probed[i].node_m[axis], expected[static_cast<Eigen::Index>(axis)]) << ticks[i].tick;
  }
  for (const ReplayedTick& tick :
       replay_models(ticks, std::vector<SentModel>{sent}, 0, firmware::kCatchUpCortexM4).ticks)
    EXPECT_TRUE(std::isnan(tick.node_m.z));  // no node of the patch
}

}  // namespace
}  // namespace palpate::host
