// The loop in its thread: what a screen asks of it, and that nobody makes it wait.

#include "host/session/live_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "host/session/test_board.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using namespace std::chrono_literals;

// Far longer than anything takes, even under a sanitizer on a busy machine.
constexpr auto kHangs = 300s;
constexpr Vec3d kAbove_m{0.0, 0.0, -0.018};

// A block of so many nodes along each side, its top at -2 cm; the hand 2 mm above it.
LiveSetup setup(int nodes = 9) {
  LatticeSpec spec = test::reference_spec(nodes);
  const double side_m = 0.01 * (nodes - 1);
  spec.origin_m = {-0.5 * side_m, -0.5 * side_m, -0.02 - side_m};
  Body body = make_lattice(spec);
  BodyState start = body.rest_state();
  ClosedLoopConfig config;
  config.session.friction.elsewhere = {0.5, 0.5};
  config.session_beside = true;
  return {.body = std::move(body),
          .start = std::move(start),
          .path = plant::TipPath::minimum_jerk({{0.0, kAbove_m}, {0.2, {0.0, 0.0, -0.023}}, {0.4, kAbove_m}}),
          .board = std::make_unique<test::MemoryPeer>(),
          .link = link::make_metered_link({}),
          .loop = std::move(config)};
}

// A loop as fast as it goes, and all of its ticks.
class Live {
 public:
  explicit Live(LiveSetup given = setup()) : loop(std::move(given)) {
    loop.set_speed(10.0);
    loop.start();
  }
  // Until `done` says so of a new tick; false when it hangs.
  template <class Done>
  bool until(Done done) {
    const auto latest = std::chrono::steady_clock::now() + kHangs;
    while (std::chrono::steady_clock::now() < latest) {
      bool found = false;
      for (LiveTick& tick : loop.feed().take_ticks()) {
        found = found || done(tick.loop);
        ticks.push_back(tick);
      }
      if (found) return true;
      if (!loop.feed().status().running) return false;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }
  bool until_mode(std::uint32_t mode) {
    return until([mode](const LoopTick& tick) { return tick.board.mode == mode; });
  }

  // Pauses; returns the tick.
  std::uint32_t stand_still() {
    loop.set_speed(0.0);
    std::uint32_t before = 0;
    const auto latest = std::chrono::steady_clock::now() + kHangs;
    for (int unchanged = 0; unchanged < 20 && std::chrono::steady_clock::now() < latest;) {
      const std::uint32_t now = loop.feed().status().tick;
      unchanged = now == before ? unchanged + 1 : 0;
      before = now;
      std::this_thread::sleep_for(5ms);
    }
    return before;
  }

  LiveLoop loop;
  std::vector<LiveTick> ticks;
};

TEST(LiveLoop, ArmsWhenAskedAndTouchesWhatTheHandGoesInto) {
  LiveSetup by_hand = setup();
  by_hand.loop.arms_by_itself = false;
  Live live(std::move(by_hand));
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.tick > 500; }));
  for (const LiveTick& tick : live.ticks) EXPECT_EQ(tick.loop.board.enabled, 0u) << tick.loop.tick;
  live.loop.arm();
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
  ASSERT_TRUE(live.loop.guide_hand({0.0, 0.0, -0.024}));
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.board.force_N[2] < -0.3f; }));
  live.loop.command(firmware::Action::disarm);
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  live.loop.stop();
  EXPECT_EQ(live.loop.feed().status().error, "");
  // Every tick, in order, came.
  for (std::size_t i = 1; i < live.ticks.size(); ++i)
    EXPECT_EQ(live.ticks[i].loop.tick, live.ticks[i - 1].loop.tick + 1);
  EXPECT_EQ(live.loop.feed().status().ticks_unseen, 0u);
}

TEST(LiveLoop, WhatIsDisarmedIsNotArmedLater) {
  LiveSetup by_hand = setup(4);
  by_hand.loop.arms_by_itself = false;
  Live live(std::move(by_hand));
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.tick > 300; }));
  const auto stays_idle = [&live](std::uint32_t ticks) {
    const std::uint32_t begin = live.loop.feed().status().tick;
    const std::size_t first = live.ticks.size();
    EXPECT_TRUE(live.until([=](const LoopTick& tick) { return tick.tick > begin + ticks; }));
    for (std::size_t i = first; i < live.ticks.size(); ++i) EXPECT_EQ(live.ticks[i].loop.board.enabled, 0u);
  };
  // In one tick, so that nothing has crossed the link before it is called back.
  live.stand_still();
  live.loop.arm();
  live.loop.command(firmware::Action::disarm);
  live.loop.set_speed(10.0);
  stays_idle(1000);
  // Without a cable nobody hears it; with one again nobody wants it any more.
  live.loop.set_unplugged(true);
  live.loop.arm();
  live.loop.command(firmware::Action::disarm);
  stays_idle(500);
  live.loop.set_unplugged(false);
  stays_idle(1000);
  live.loop.arm();
  EXPECT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
}

TEST(LiveLoop, EmergencyStopIsLatchedUntilItIsClearedAndArmedAgain) {
  Live live;
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
  live.loop.set_emergency_stop(true);
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_FAULT));
  live.loop.set_emergency_stop(false);
  const std::uint32_t closed = live.loop.feed().status().tick;
  ASSERT_TRUE(live.until([closed](const LoopTick& tick) { return tick.tick > closed + 500; }));
  EXPECT_EQ(live.ticks.back().loop.board.mode, std::uint32_t{palpate_BoardStatus_1_0_MODE_FAULT});
  live.loop.command(firmware::Action::clear_fault);
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  live.loop.arm();
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
}

TEST(LiveLoop, WithoutACableModelsGrowOldAndTheForceFades) {
  Live live;
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
  ASSERT_TRUE(live.loop.guide_hand({0.0, 0.0, -0.024}));
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.board.force_N[2] < -0.3f; }));
  live.loop.set_unplugged(true);
  ASSERT_TRUE(live.until([](const LoopTick& tick) {
    return tick.board.model_age_ticks > 300 && tick.board.force_N[2] == 0.0f;
  }));
  live.loop.set_unplugged(false);
  EXPECT_TRUE(live.until([](const LoopTick& tick) { return tick.board.force_N[2] < -0.3f; }));
}

TEST(LiveLoop, LostFramesAreCounted) {
  Live live;
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
  const std::uint32_t tick = live.stand_still();
  live.loop.add_faults(false, link::FaultKind::drop, 0, 20);
  live.loop.add_faults(false, link::FaultKind::drop, 0, 20);  // the same frames: no more are lost
  live.loop.set_speed(10.0);
  ASSERT_TRUE(live.until([tick](const LoopTick& now) { return now.tick > tick + 1000; }));
  // A gap shows when the next frame of its kind comes: of each of the board's five the last lost one may be
  // none yet.
  EXPECT_LE(live.loop.feed().status().counters.frames_lost_up, 20u);
  EXPECT_GE(live.loop.feed().status().counters.frames_lost_up, 15u);
  EXPECT_THROW(live.loop.add_faults(true, link::FaultKind::reorder, 0, 1), std::invalid_argument);
  EXPECT_THROW(live.loop.add_faults(true, link::FaultKind::drop, 0, 0), std::invalid_argument);
}

TEST(LiveLoop, PlaysItsPathAndShowsTheBodyOnlyWhenAskedTo) {
  Live live;
  ASSERT_TRUE(live.until_mode(palpate_BoardStatus_1_0_MODE_RENDER));
  live.loop.play_path();
  double deepest_m = 0.0;
  std::shared_ptr<const LivePicture> bent;
  ASSERT_TRUE(live.until([&](const LoopTick& tick) {
    deepest_m = std::min(deepest_m, tick.true_tip_m.z);
    if (const auto picture = live.loop.feed().take_picture()) {
      EXPECT_FALSE(bent && bent->tick >= picture->tick);  // each is new
      bent = picture;
    }
    return deepest_m < -0.0215 && tick.true_tip_m.z > -0.019;
  }));
  ASSERT_TRUE(bent);
  EXPECT_EQ(bent->state.position_m.cols(), 9 * 9 * 9);
  EXPECT_FALSE(bent->patch_nodes.empty());
  std::uint32_t last = 0;
  for (const UpdateRecord& update : live.loop.feed().take_updates()) {
    EXPECT_EQ(update.sequence, last + 1);
    last = update.sequence;
  }
  EXPECT_GT(last, 5u);
}

TEST(LiveLoop, NobodyWhoLooksMakesItWait) {
  Live live(setup(4));
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.tick > 100; }));
  // Nobody takes anything now.
  const auto latest = std::chrono::steady_clock::now() + kHangs;
  while (live.loop.feed().status().ticks_unseen == 0 && std::chrono::steady_clock::now() < latest)
    std::this_thread::sleep_for(10ms);
  EXPECT_GT(live.loop.feed().status().ticks_unseen, 0u);
  EXPECT_EQ(live.loop.feed().take_ticks().size(), LiveFeed::kMostTicks);
}

TEST(LiveLoop, PausesAndRefusesWhatIsOutOfRange) {
  Live live;
  ASSERT_TRUE(live.until([](const LoopTick& tick) { return tick.tick > 100; }));
  const std::uint32_t before = live.stand_still();
  EXPECT_FALSE(live.loop.guide_hand({1.0, 1.0, 1.0}));
  EXPECT_THROW(live.loop.set_grip(1.5), std::invalid_argument);
  EXPECT_THROW(live.loop.set_speed(-1.0), std::invalid_argument);
  EXPECT_THROW(live.loop.set_host_delay(100'000), std::invalid_argument);
  live.loop.set_speed(10.0);
  EXPECT_TRUE(live.until([before](const LoopTick& tick) { return tick.tick > before + 10; }));
}

TEST(LiveLoop, ABoardThatDiesEndsItWithAReason) {
  class Dying final : public LockstepPeer {
   public:
    void send(const lockstep::SensorFrame& frame) override {
      if (frame.tick == 50) throw std::runtime_error("board: its sensor stream is closed");
      peer_.send(frame);
    }
    void receive(lockstep::ActuatorFrame& frame) override { peer_.receive(frame); }

   private:
    test::MemoryPeer peer_;
  };
  LiveSetup dying = setup();
  dying.board = std::make_unique<Dying>();
  Live live(std::move(dying));
  EXPECT_FALSE(live.until([](const LoopTick& tick) { return tick.tick > 50; }));
  EXPECT_FALSE(live.loop.feed().status().running);
  EXPECT_EQ(live.loop.feed().status().error, "board: its sensor stream is closed");
}

TEST(LiveLoop, RefusesAScriptedHand) {
  LiveSetup scripted = setup();
  scripted.plant.hand_kind = plant::HandKind::scripted;
  EXPECT_THROW(LiveLoop{std::move(scripted)}, std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
