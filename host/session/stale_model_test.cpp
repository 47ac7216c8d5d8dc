// Models that do not come, to a board whose host is heard: because nothing is near the tip, or because they
// are lost. The whole loop in one process, its board the firmware in memory.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "firmware/core/supervisor.hpp"
#include "host/link/uart.hpp"
#include "host/plant/plant.hpp"
#include "host/session/closed_loop.hpp"
#include "host/session/test_board.hpp"
#include "host/session/test_contact.hpp"
#include "host/session/test_line.hpp"

namespace palpate::host {
namespace {

constexpr std::uint32_t kBaud = 12'000'000;
constexpr double kFelt_N = 0.3;  // where 3 mm meet some 300 N/m
constexpr auto kRender = static_cast<std::uint32_t>(firmware::Mode::render);

constexpr auto kSuspended = static_cast<std::uint32_t>(firmware::Mode::suspended);

// To the board, but for the states that are taken from it.
class Picky final : public test::WatchedLine {
 public:
  using Takes = std::function<bool(const palpate_ModelState_1_0&, std::uint32_t tick)>;
  explicit Picky(Takes takes) : WatchedLine(kBaud), takes_(std::move(takes)) {}
  bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) override {
    // Several frames at once where they have been waiting.
    for (std::span<const std::uint8_t> left = bytes; !left.empty();) {
      const wire::Reception reception = receive(left);
      left = left.subspan(reception.consumed);
      if (!reception.complete || reception.frame.header.specifier != wire::kModelStateSubject) continue;
      EXPECT_EQ(wire::deserialize(reception.frame.payload, state_), Status::ok);
      if (state_.valid_ticks == 0) ++nothings;
      if (takes_(state_, tick)) return true;
      state_ticks.push_back(tick);
    }
    return WatchedLine::submit(bytes, tick);
  }

  int nothings = 0;                        // that the host has sent
  std::vector<std::uint32_t> state_ticks;  // in which states went on to the board

 private:
  Takes takes_;
  palpate_ModelState_1_0 state_{};
};

Body body() {
  LatticeSpec spec = test::reference_spec(5);
  spec.origin_m = {-0.02, -0.02, -0.06};  // the top at -2 cm
  return make_lattice(spec);
}

std::vector<LoopTick> run(const plant::TipPath& path, std::uint32_t ticks, Picky& down,
                          const LinkTroubles& troubles = {}) {
  const Body of = body();
  ClosedLoopConfig config;
  config.ticks = ticks;
  config.host_delay_ticks = 5;
  config.troubles = troubles;
  plant::PlantParameters parameters;
  parameters.hand_kind = plant::HandKind::scripted;
  plant::Plant plant(parameters, path);
  test::MemoryPeer board;
  link::Uart up(kBaud);
  return run_closed_loop(of, of.rest_state(), plant, board, down, up, config, {}).ticks;
}

double force_N(const LoopTick& row) {
  const auto& force = row.board.force_N;
  return norm(
      Vec3d{static_cast<double>(force[0]), static_cast<double>(force[1]), static_cast<double>(force[2])});
}

double largest_N(const std::vector<LoopTick>& ticks, std::uint32_t first_tick, std::uint32_t end_tick) {
  double largest = 0.0;
  for (const LoopTick& row : ticks)
    if (row.tick >= first_tick && row.tick < end_tick) largest = std::max(largest, force_N(row));
  return largest;
}

// Pressed 3 mm from 0.3 to 0.5 s, 6 cm away from 0.8 to 4 s, and pressed again from 4.3 s on.
constexpr std::uint32_t kAway = 800, kBack = 4000, kEnd = 4500;
plant::TipPath there_and_back() {
  constexpr double kAbove_m = -0.0195, kDeep_m = -0.023, kFar_m = 0.04;
  return plant::TipPath::minimum_jerk({{0.1, {0.002, 0.002, kAbove_m}},
                                       {0.3, {0.002, 0.002, kDeep_m}},
                                       {0.5, {0.002, 0.002, kDeep_m}},
                                       {0.8, {0.002, 0.002, kFar_m}},
                                       {4.0, {0.002, 0.002, kFar_m}},
                                       {4.3, {0.002, 0.002, kDeep_m}},
                                       {4.5, {0.002, 0.002, kDeep_m}}});
}

void expect_never_tripped(const std::vector<LoopTick>& ticks) {
  const auto armed =
      std::find_if(ticks.begin(), ticks.end(), [](const LoopTick& row) { return row.board.mode == kRender; });
  ASSERT_NE(armed, ticks.end());
  ASSERT_LT(armed->tick, 100u);
  for (auto row = armed; row != ticks.end(); ++row) {
    ASSERT_EQ(row->board.mode, kRender) << row->tick;
    ASSERT_EQ(row->board.faults, 0u) << row->tick;
    // Not even the damper: what the tip touches nothing with has no force.
    if (row->tick > kAway - 100 && row->tick < kBack) {
      ASSERT_EQ(force_N(*row), 0.0) << row->tick;
    }
  }
  // Where it has been held for 0.18 s; 2 %: what is left of two approaches that are not as fast.
  const double first_N = largest_N(ticks, kAway - 320, kAway - 300),
               again_N = largest_N(ticks, kEnd - 20, kEnd);
  EXPECT_GT(first_N, kFelt_N);
  EXPECT_NEAR(again_N, first_N, 0.02 * first_N);
}

// The cable is out for two seconds: outputs go off, and come on again with what the host says once more.
TEST(StaleModel, OutputsComeBackWhileTheTipIsStillFar) {
  Picky down([](const palpate_ModelState_1_0&, std::uint32_t) { return false; });
  constexpr std::uint32_t kOut = 1500, kIn = 3500;
  LinkTroubles troubles;
  troubles.unplugged = {{kOut, kIn}};
  const std::vector<LoopTick> ticks = run(there_and_back(), kEnd, down, troubles);
  const auto mode = [&](std::uint32_t tick) { return ticks.at(tick).board.mode; };
  EXPECT_EQ(mode(kOut), kRender);
  EXPECT_EQ(mode(kIn - 1), kSuspended);
  EXPECT_EQ(mode(kIn + 300), kRender);
  EXPECT_EQ(largest_N(ticks, kIn, kBack), 0.0);
  EXPECT_EQ(ticks.back().board.faults, 0u);
  EXPECT_GT(largest_N(ticks, kEnd - 20, kEnd), kFelt_N);
}

TEST(StaleModel, ATipThatIsFarForSecondsIsNone) {
  // Of what says so the first two are lost.
  int lost = 0;
  Picky down([&](const palpate_ModelState_1_0& state, std::uint32_t) {
    return state.valid_ticks == 0 && ++lost <= 2;
  });
  const std::vector<LoopTick> ticks = run(there_and_back(), kEnd, down);
  expect_never_tripped(ticks);
  EXPECT_EQ(down.nothings, 3);
  // Then there is not a byte of models any more.
  const auto& sent = down.state_ticks;
  EXPECT_EQ(std::count_if(sent.begin(), sent.end(),
                          [](std::uint32_t tick) { return tick > kAway + 200 && tick < kBack; }),
            0);
}

TEST(StaleModel, ThirtyMillisecondsOfJitterMakeNone) {
  Picky down([](const palpate_ModelState_1_0&, std::uint32_t) { return false; });
  LinkTroubles troubles;
  troubles.delay_down = troubles.delay_up = {{.delay_ticks = 0, .jitter_ticks = 30}};
  expect_never_tripped(run(there_and_back(), kEnd, down, troubles));
}

TEST(StaleModel, FadesDampsAndSwitchesOffThoughTheHostIsHeard) {
  constexpr std::uint32_t kFirst = 600, kUntil = 2600, kTicks = 3000;
  const plant::TipPath press = plant::TipPath::minimum_jerk(
      {{0.1, {0.002, 0.002, -0.0195}}, {0.3, {0.002, 0.002, -0.023}}, {3.0, {0.002, 0.002, -0.023}}});
  Picky down(
      [](const palpate_ModelState_1_0&, std::uint32_t tick) { return tick >= kFirst && tick < kUntil; });
  const std::vector<LoopTick> ticks = run(press, kTicks, down);
  const SessionConfig session;
  const firmware::Limits limits;
  const std::uint32_t faded = session.valid_ticks + limits.model_fade_ticks;
  std::uint32_t off_tick = 0, on_tick = 0;
  for (const LoopTick& row : ticks) {
    ASSERT_EQ(row.board.faults, 0u) << row.tick;
    if (row.tick < kFirst) continue;
    const std::uint32_t age = row.board.model_age_ticks;
    if (row.board.mode == kSuspended) {
      if (off_tick == 0) {
        off_tick = row.tick;
        EXPECT_EQ(age, faded + limits.damping_ticks);
      }
      ASSERT_EQ(row.board.enabled, 0u) << row.tick;
      continue;
    }
    ASSERT_EQ(row.board.mode, kRender) << row.tick;
    if (off_tick != 0 && on_tick == 0) on_tick = row.tick;
    if (on_tick != 0) continue;
    if (age <= session.valid_ticks) {
      ASSERT_GT(force_N(row), kFelt_N) << row.tick;
    } else if (age >= faded) {
      // The damper of a tip that stands still, but for an encoder's counts.
      ASSERT_LT(force_N(row), 0.02) << row.tick;
    }
  }
  // It goes on with the first model: by the soft start.
  ASSERT_GT(on_tick, kUntil);
  ASSERT_LT(on_tick, kUntil + 100);
  EXPECT_LT(largest_N(ticks, on_tick, on_tick + limits.soft_start_ticks / 2),
            0.6 * largest_N(ticks, 0, kFirst));
  EXPECT_GT(largest_N(ticks, on_tick + limits.soft_start_ticks, kTicks), kFelt_N);
}

}  // namespace
}  // namespace palpate::host
