// A tip that comes back from beyond the border of the board's model of a real body: on a patch of which the
// surroundings are held the border yields little, and the contact is not lost
// (shared/contact/border_test.cpp: over a border of single masses).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "host/bench/board_patch.hpp"
#include "host/msd/test_bodies.hpp"
#include "shared/contact/contact.hpp"
#include "shared/model/modal_surface.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host::bench {
namespace {

TEST(BorderReturn, KeepsTheContact) {
  LatticeSpec spec = test::reference_spec(8, 1.0);
  spec.nodes[2] = 4;
  const Body body = make_lattice(spec);
  constexpr double kTop_m = 0.03, kHalfWidth_m = 0.015;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0.0, 1.0), both(-1.0, 1.0);
  int beyond = 0;
  for (int i = 0; i < 300; ++i) {
    BoardPatch patch(body, body.rest_state(), {0.035, 0.035, kTop_m}, SurfaceKind::smooth, share(random));
    ModalSurface surface;
    surface.bind(patch.view(), patch.state());
    ContactState<float> contact;
    const Vec3d middle_m = widen(patch.view().origin_m);
    const double below_m = kTop_m - (0.001 + 0.002 * share(random));
    Vec3d tip_m = middle_m + Vec3d{kHalfWidth_m - 0.006, 0.007 * both(random), 0.0};
    tip_m.z = kTop_m + 0.002;
    bool lost = false;
    const auto go = [&](const Vec3d& to_m, double speed_m_s) {
      lost = false;
      const Vec3d from_m = tip_m;
      const int ticks = std::max(1, static_cast<int>(std::lround(norm(to_m - from_m) / speed_m_s / kTick_s)));
      for (int k = 1; k <= ticks; ++k) {
        const Vec3d next_m = from_m + (to_m - from_m) * (static_cast<double>(k) / ticks);
        step_contact(surface, contact, ContactLaw<float>{}, patch.to_patch(tip_m), patch.to_patch(next_m));
        tip_m = next_m;
        lost |= contact.mode == ContactMode::free;
      }
    };
    const auto settle = [&] {
      for (int k = 0; k < 100; ++k) go(tip_m, 1.0);
    };
    go({tip_m.x, tip_m.y, below_m}, 0.03);
    settle();
    // Not to where the plane goes down.
    const double out_m = 0.001 + 0.0055 * share(random);
    go({middle_m.x + kHalfWidth_m + out_m, tip_m.y + 0.006 * both(random), below_m}, 0.03);
    ASSERT_FALSE(lost) << i;
    settle();
    beyond += contact.at_border && norm(contact.overhang_m) > 0.0005f;
    go({middle_m.x + kHalfWidth_m - 0.008, middle_m.y + 0.007 * both(random), below_m},
       0.02 + 0.18 * share(random));
    EXPECT_FALSE(lost) << i;
    EXPECT_FALSE(contact.at_border) << i;
  }
  EXPECT_GT(beyond, 250);
}
}  // namespace
}  // namespace palpate::host::bench
