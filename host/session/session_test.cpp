#include "host/session/session.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <vector>

#include "host/msd/vectors.hpp"
#include "host/session/session_test_bed.hpp"
#include "host/session/simulation.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::kSamplesPerTrace;
using test::Path;
using test::trace;

Path in_single_precision(Path path) {
  for (Vec3d& tip : path.tip_m)
    for (std::size_t axis = 0; axis < 3; ++axis)
      tip[axis] = static_cast<double>(static_cast<float>(tip[axis]));
  return path;
}

class SessionTest : public test::SessionTestBed {
 protected:
  BodyState simulated_until(std::uint32_t tick) {
    const Path measured = in_single_precision(path_);
    SimulationConfig config;
    config.law = config_.law;
    config.friction = config_.friction;
    config.ticks = tick;
    config.tip_m.assign(measured.tip_m.begin(), measured.tip_m.begin() + tick + 1);
    config.export_ticks = {tick};
    return simulate(body_, body_.rest_state(), config, {}).exported.at(0);
  }
};

TEST_F(SessionTest, IsDueAtItsRate) {
  for (const double rate_Hz : {1.0, 30.0, 60.0, 333.0, 1000.0}) {
    config_.update_Hz = rate_Hz;
    const Session session(body_, body_.rest_state(), config_);
    std::uint32_t count = 0;
    for (std::uint32_t tick = 0; tick <= 10000; ++tick) count += session.due(tick);
    // An update that falls on a tick's boundary may be counted one tick later.
    EXPECT_NEAR(count, 10.0 * rate_Hz, 1.0) << rate_Hz;
  }
}

TEST_F(SessionTest, ReplaysThePathAsASimulationOfIt) {
  Session session(body_, body_.rest_state(), config_);
  EXPECT_FALSE(session.update());  // nothing heard yet
  const auto updates = run(session);
  ASSERT_EQ(updates.size(), 5u);
  std::uint32_t sequence = 0;
  for (const ModelUpdate& update : updates) {
    EXPECT_EQ(update.message.sequence, ++sequence);
    EXPECT_EQ(update.message.valid_ticks, config_.valid_ticks);
    EXPECT_EQ(update.interpolated_ticks, 0u);
    const BodyState expected = simulated_until(update.message.tick);
    EXPECT_EQ(update.state.position_m, expected.position_m) << "tick " << update.message.tick;
    EXPECT_EQ(update.state.velocity_m_s, expected.velocity_m_s) << "tick " << update.message.tick;
    EXPECT_EQ(update.patch_nodes.size(), update.message.nodes);
  }
  EXPECT_TRUE(session.missing().empty());
  EXPECT_TRUE(session.interpolated().empty());
  // The contact travels with the model: its triangle is one of the patch's.
  const wire::ModelContents& last = updates.back().message;
  EXPECT_NE(last.contact.mode, 0u);
  EXPECT_EQ(std::count(last.triangle_id.elements, last.triangle_id.elements + last.triangles,
                       last.contact.triangle),
            1);
  EXPECT_EQ(last.contact.triangle, session.contact().triangle);
}

TEST_F(SessionTest, NoNewsNoModel) {
  Session session(body_, body_.rest_state(), config_);
  session.take(trace(path_, 0));
  EXPECT_TRUE(session.update());
  EXPECT_FALSE(session.update());
}

// Whether the tip starts inside the body is known after a tick: no model without it.
TEST_F(SessionTest, TheFirstModelOfATipInsideHasTheContact) {
  Path inside({0.0145, 0.0165, -6e-3});
  path_ = inside.hold(kSamplesPerTrace);
  Session session(body_, body_.rest_state(), config_);
  palpate_ServoTrace_1_0 one = trace(path_, 0);
  one.samples.count = 1;
  session.take(one);
  EXPECT_FALSE(session.update());
  session.take(trace(path_, 0));
  const auto update = session.update();
  ASSERT_TRUE(update);
  EXPECT_NE(update->message.contact.mode, 0u);
  EXPECT_GT(update->message.contact.inset_m, 5e-3f);
}

TEST_F(SessionTest, AGapIsAskedForAndWaitedFor) {
  Session whole(body_, body_.rest_state(), config_), session(body_, body_.rest_state(), config_);
  const auto expected = run(whole);
  constexpr std::uint32_t kLost = 40, kUntil = 80;
  for (std::uint32_t first = 0; first < kUntil; first += kSamplesPerTrace)
    if (first != kLost) session.take(trace(path_, first));
  const auto missing = session.missing();
  ASSERT_EQ(missing.size(), 1u);
  EXPECT_EQ(missing[0].first, kLost);
  EXPECT_EQ(missing[0].count, kSamplesPerTrace);
  const auto before = session.update();
  ASSERT_TRUE(before);
  EXPECT_EQ(before->message.tick, kLost - 1);
  session.take(trace(path_, kLost));  // sent again
  const auto after = session.update();
  ASSERT_TRUE(after);
  EXPECT_EQ(after->message.tick, kUntil - 1);
  EXPECT_EQ(after->interpolated_ticks, 0u);
  EXPECT_TRUE(session.interpolated().empty());
  EXPECT_EQ(after->state.position_m, simulated_until(kUntil - 1).position_m);
}

TEST_F(SessionTest, AGapThatStaysIsInterpolatedAndSaid) {
  Session session(body_, body_.rest_state(), config_);
  constexpr std::uint32_t kLost = 40, kUntil = 80;
  for (std::uint32_t first = 0; first < kUntil; first += kSamplesPerTrace)
    if (first != kLost) session.take(trace(path_, first));
  ASSERT_TRUE(session.update());
  EXPECT_EQ(session.tick(), kLost - 1);
  const auto update = session.update();
  ASSERT_TRUE(update);
  EXPECT_EQ(session.tick(), kUntil - 1);
  EXPECT_EQ(update->interpolated_ticks, kSamplesPerTrace);
  ASSERT_EQ(session.interpolated().size(), kSamplesPerTrace);
  EXPECT_TRUE(session.missing().empty());
  for (std::uint32_t i = 0; i < kSamplesPerTrace; ++i) {
    const Session::Interpolated& guess = session.interpolated()[i];
    EXPECT_EQ(guess.tick, kLost + i);
    EXPECT_EQ(guess.sequence, update->message.sequence);
    // The path's curvature, (2.5 mm) 6 / (60 ms)^2, over half the gap of 5 ms: h^2 / 8 times it.
    EXPECT_LE(norm(guess.tip_m - path_.tip_m[kLost + i]), 2.5e-3 * 6.0 / (60.0 * 60.0) * 25.0 / 8.0);
  }
  // Only once: the next model builds on nothing new that was guessed.
  session.take(trace(path_, kUntil));
  const auto next = session.update();
  ASSERT_TRUE(next);
  EXPECT_EQ(next->interpolated_ticks, 0u);
}

// A board that has started again says small ticks; after a minute without a cable they are far ahead.
TEST_F(SessionTest, GoesOnWithTicksOfAnotherPath) {
  for (const std::uint32_t begin : {100'000u, 3u}) {
    Session session(body_, body_.rest_state(), config_);
    const auto shifted = [](palpate_ServoTrace_1_0 message, std::uint32_t by) {
      message.first_tick += by;
      return message;
    };
    for (std::uint32_t tick = 0; tick <= path_.ticks(); tick += kSamplesPerTrace)
      session.take(shifted(trace(path_, tick), 20'000));
    ASSERT_TRUE(session.update());
    const std::uint32_t before = session.tick();
    for (std::uint32_t tick = 0; tick <= path_.ticks(); tick += kSamplesPerTrace)
      session.take(shifted(trace(path_, tick), begin));
    const auto update = session.update();
    ASSERT_TRUE(update) << begin;
    EXPECT_NE(session.tick(), before);
    EXPECT_EQ(session.tick(), begin + path_.ticks());
    EXPECT_EQ(update->message.tick, session.tick());
    EXPECT_NE(session.contact().mode, ContactMode::free);
    EXPECT_TRUE(update->state.position_m.allFinite());
  }
}

TEST_F(SessionTest, TheBodyMovesOnButNoModelIsBuiltFarAway) {
  Path far({0.0145, 0.0165, 0.05});
  far.hold(50).to({0.0145, 0.0165, 0.019}, 50);
  path_ = far;
  Session session(body_, body_.rest_state(), config_);
  for (std::uint32_t first = 0; first < 48; first += kSamplesPerTrace) session.take(trace(path_, first));
  EXPECT_FALSE(session.update());
  EXPECT_EQ(session.tick(), 47u);
  for (std::uint32_t first = 48; first <= 100; first += kSamplesPerTrace) session.take(trace(path_, first));
  const auto near = session.update();  // 19 mm above the surface, near_m is 20
  ASSERT_TRUE(near);
  EXPECT_EQ(near->message.tick, 100u);
  EXPECT_EQ(near->message.contact.mode, 0u);
}

// Half of a model's horizon after the newest one, at each update until the board has taken it, and not again.
TEST_F(SessionTest, SaysThatNothingIsNearUntilTheBoardHasHeard) {
  path_ = Path({0.0145, 0.0165, 5e-4});
  path_.hold(50).to({0.0145, 0.0165, 0.05}, 50).hold(300).to({0.0145, 0.0165, 5e-4}, 50).hold(50);
  path_.to({0.0145, 0.0165, 0.05}, 50).hold(250);
  std::uint32_t told = 0;
  Session session(body_, body_.rest_state(), config_);
  std::vector<ModelUpdate> updates;
  std::uint32_t sequence = 0;
  for (std::uint32_t tick = 0; tick <= path_.ticks(); ++tick) {
    if (tick % kSamplesPerTrace == kSamplesPerTrace - 1)
      session.take(trace(path_, tick + 1 - kSamplesPerTrace));
    if (!session.due(tick)) continue;
    auto update = session.update();
    if (!update) continue;
    EXPECT_EQ(update->message.sequence, ++sequence);
    // Two are lost on the way.
    if (update->says_nothing() && ++told > 2) session.note_taken(update->message.tick, tick + 3);
    updates.push_back(std::move(*update));
  }
  std::vector<std::uint32_t> nothing, between;
  std::uint32_t newest = 0;
  for (const ModelUpdate& update : updates) {
    if (!update.says_nothing()) {
      newest = update.message.tick;
      EXPECT_EQ(update.message.valid_ticks, config_.valid_ticks);
      continue;
    }
    nothing.push_back(update.message.tick);
    between.push_back(update.message.tick - newest);
    EXPECT_EQ(update.message.kind, palpate_ModelState_1_0_KIND_HELD_FORCE);
    EXPECT_EQ(update.message.valid_ticks, 0u);
    EXPECT_EQ(update.message.contact.mode, palpate_Contact_1_0_MODE_FREE);
    for (const float force_N : update.message.contact.force_N) EXPECT_EQ(force_N, 0.0f);
    EXPECT_EQ(update.packed.basis, nullptr);
    EXPECT_TRUE(update.patch_nodes.empty());
  }
  // Three times for the first excursion, once for the second, and models in between.
  constexpr std::uint32_t kPeriod_ticks = 34;
  ASSERT_EQ(nothing.size(), 4u);
  EXPECT_LE(nothing[2] - nothing[0], 2 * kPeriod_ticks);
  for (const std::size_t first : {0u, 3u}) {
    EXPECT_GE(between[first], config_.valid_ticks / 2u);
    EXPECT_LE(between[first], config_.valid_ticks / 2u + kPeriod_ticks);
  }
  EXPECT_GT(nothing[3], nothing[2] + 200);
}

// A host that comes anew does not know what one before it has left on the board.
TEST_F(SessionTest, SaysSoToABoardThatItHasSentNoModel) {
  path_ = Path({0.0145, 0.0165, 0.05});
  path_.hold(300);
  Session session(body_, body_.rest_state(), config_);
  std::vector<ModelUpdate> updates = run(session);
  ASSERT_FALSE(updates.empty());
  for (const ModelUpdate& update : updates) EXPECT_TRUE(update.says_nothing());
  EXPECT_GE(updates.front().message.tick, config_.valid_ticks / 2u);
  session.note_taken(updates.back().message.tick, updates.back().message.tick + 3);
  EXPECT_FALSE(session.update());
  // Nor what is on a board whose ticks go on elsewhere.
  constexpr std::uint32_t kElsewhere = 100'000;
  for (std::uint32_t first = 0; first <= path_.ticks(); first += kSamplesPerTrace) {
    palpate_ServoTrace_1_0 message = trace(path_, first);
    message.first_tick += kElsewhere;
    session.take(message);
  }
  const auto again = session.update();
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->says_nothing());
}

TEST_F(SessionTest, RefusesAStepThatDoesNotDivideTheTick) {
  config_.step_s = 1.5e-4;
  EXPECT_NE(test::message_of<std::invalid_argument>([&] { Session(body_, body_.rest_state(), config_); }),
            "");
}

TEST_F(SessionTest, PutsThePatchAroundTheContactUnlessAhead) {
  config_.patch_ahead = false;
  config_.law.tip_radius_m = 4e-3;
  path_ = Path{{0.0145, 0.0165, 5e-3}};
  path_.to({0.0145, 0.0165, 2e-3}, 100).to({0.0245, 0.0175, 2e-3}, 200);
  Session session(body_, body_.rest_state(), config_);
  int touching = 0;
  for (std::uint32_t tick = 3; tick <= path_.ticks(); tick += kSamplesPerTrace) {
    session.take(trace(path_, tick - 3));
    if (tick % 32 != 31) continue;
    const auto update = session.update();
    if (!update || session.contact().mode == ContactMode::free) continue;
    ++touching;
    const SurfacePoint contact{static_cast<int>(session.contact().triangle),
                               to_eigen(session.contact().barycentric)};
    const std::vector<int> nodes = select_patch(body_, contact, config_.model.patch);
    for (const int node : update->patch_nodes)
      EXPECT_NE(std::find(nodes.begin(), nodes.end(), node), nodes.end());
  }
  EXPECT_GE(touching, 4);
}

TEST_F(SessionTest, PutsThePatchAhead) {
  // 3 cm/s along the top of a block; the board takes a model over 60 ticks after its own.
  const Body body = block(10);
  path_ = Path{{0.0245, 0.0465, 5e-4}};
  path_.to({0.0245, 0.0465, -1e-3}, 100).to({0.0545, 0.0465, -1e-3}, 1000);
  const auto patches = [&](bool ahead, std::uint32_t late) {
    config_.patch_ahead = ahead;
    Session session(body, body.rest_state(), config_);
    if (late != 0)
      for (int i = 0; i < 40; ++i) session.note_taken(1, 1 + late);
    return run(session);
  };
  // When the patch first reaches x = 6 cm: its nodes at rest.
  const auto first = [&](const std::vector<ModelUpdate>& updates) {
    for (const ModelUpdate& update : updates)
      for (const int node : update.patch_nodes)
        if (body.rest_position_m()(0, node) > 0.059) return update.message.tick;
    return 0u;
  };
  const auto here = patches(false, 60), ahead = patches(true, 60), far_ahead = patches(true, 300);
  ASSERT_EQ(here.size(), ahead.size());
  // 60 ticks and half a period of 33 are 77 ticks; updates come every 33.
  EXPECT_GT(first(here), first(ahead) + 50);
  EXPECT_LT(first(here), first(ahead) + 110);
  EXPECT_LT(first(far_ahead), first(ahead));
  // The contact is on every patch, however far ahead it should be.
  for (const ModelUpdate& update : far_ahead) {
    const auto* const end = update.message.triangle_id.elements + update.message.triangles;
    if (update.message.contact.mode != 0) {
      EXPECT_NE(std::find(update.message.triangle_id.elements, end, update.message.contact.triangle), end);
    }
  }
}

}  // namespace
}  // namespace palpate::host
