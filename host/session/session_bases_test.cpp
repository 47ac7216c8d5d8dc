// Bases that are computed beside the session, in a thread of their own.
#include <gtest/gtest.h>

#include <optional>

#include "host/session/session.hpp"
#include "host/session/session_test_bed.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::kSamplesPerTrace;
using test::Path;
using test::trace;
using SessionBases = test::SessionTestBed;

TEST_F(SessionBases, WantsBasesBeforeTheTipIsThere) {
  // 3 cm along the top of a block, up to 7.5 cm/s: from cell to cell another patch.
  const Body body = block(10);
  path_ = Path{{0.0145, 0.0465, 5e-4}};
  path_.to({0.0145, 0.0465, -1e-3}, 500).to({0.0445, 0.0465, -1e-3}, 600);
  config_.model.builder = Builder::krylov;
  config_.model.tangent = TangentAt::rest;
  config_.model.shift_rad_s = {0.0};
  config_.model.bases = {BasisTiming::virtual_time, 100, std::nullopt};
  Session foreseen(body, body.rest_state(), config_);
  const auto updates = run(foreseen);
  EXPECT_GT(updates.size(), 28u);
  // Only at the beginning, when nothing could be known before.
  EXPECT_LE(foreseen.basis_waits(), 4u);
  // Too slow for the tip, it goes on with the patch before, as far as that goes.
  config_.model.bases.latency_ticks = 300;
  Session slow(body, body.rest_state(), config_);
  EXPECT_GT(run(slow).size(), 11u);
  EXPECT_GT(slow.basis_waits(), 9u);
}

// The tip moves on slowly until the next patch is looked for, and turns back into a cell whose own patch is
// not there: the patch on the board has the contact, the one that was looked up last has not.
TEST_F(SessionBases, GoesOnWithThePatchOnTheBoardWhenTheTipTurns) {
  const Body body = block(10);
  config_.model.builder = Builder::krylov;
  config_.model.tangent = TangentAt::rest;
  config_.model.shift_rad_s = {0.0};
  config_.model.bases = {BasisTiming::virtual_time, 400, std::nullopt};
  config_.friction.elsewhere = {0.0, 0.0};
  path_ = Path{{0.041, 0.0465, -5e-4}};
  for (int tick = 1; tick <= 1500; ++tick) path_.tip_m.push_back({0.041 + 5.633e-6 * tick, 0.0465, -5e-4});
  path_.to({0.033, 0.0465, -5e-4}, 30).to({0.032, 0.0465, -5e-4}, 100);
  Session session(body, body.rest_state(), config_);
  std::uint32_t held = 0;
  std::size_t waits_before = 0;
  int after_the_turn = 0;
  bool wanted_the_next = false;
  for (std::uint32_t tick = 0; tick <= path_.ticks(); ++tick) {
    if (tick % kSamplesPerTrace == kSamplesPerTrace - 1)
      session.take(trace(path_, tick + 1 - kSamplesPerTrace));
    if (!session.due(tick)) continue;
    const auto update = session.update();
    if (tick <= 1500) {
      if (update && held == 0) held = update->packed.state.basis_id;
      if (held != 0) session.note_held_bases({held});
      wanted_the_next = update && update->packed.state.basis_id == held && update->wanted_basis != nullptr;
      waits_before = session.basis_waits();
    } else {
      ASSERT_TRUE(update) << tick;
      EXPECT_EQ(update->packed.state.basis_id, held) << tick;
      ++after_the_turn;
    }
  }
  EXPECT_TRUE(wanted_the_next);
  EXPECT_GE(after_the_turn, 3);
  EXPECT_GT(session.basis_waits(), waits_before);
}

TEST_F(SessionBases, PreparesBetweenRareUpdates) {
  config_.update_Hz = 2.0;
  config_.model.builder = Builder::krylov;
  config_.model.tangent = TangentAt::rest;
  config_.model.shift_rad_s = {0.0};
  config_.model.bases = {BasisTiming::virtual_time, 100, std::nullopt};
  path_ = Path{{0.0145, 0.0165, 5e-4}};
  path_.to({0.0145, 0.0165, -2e-3}, 540);
  for (const bool prepares : {false, true}) {
    Session session(body_, body_.rest_state(), config_);
    for (std::uint32_t tick = 3; tick <= 500; tick += kSamplesPerTrace) {
      session.take(trace(path_, tick - 3));
      if (prepares) session.prepare();
    }
    EXPECT_EQ(session.update().has_value(), prepares);
    EXPECT_EQ(session.basis_waits(), prepares ? 0u : 1u);
  }
}

}  // namespace
}  // namespace palpate::host
