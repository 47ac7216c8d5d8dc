#include "shared/contact/contact.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "shared/contact/test_bed.hpp"

namespace palpate {
namespace {

using test::Bed;
using test::kNothing;
using test::move;

TEST(Contact, NoForceBeforeTheSurfaceIsReached) {
  Bed bed;
  ContactState<double> state;
  move(bed, state, {}, {0.021, 0.023, 0.02}, {0.021, 0.023, 0.0001}, 0.2,
       [&](const Vec3d&) { EXPECT_EQ(state.mode, ContactMode::free); });
}

TEST(Contact, PressingSticksWhereTheSurfaceWasMet) {
  Bed bed;
  ContactState<double> state;
  const Vec3d tip = move(bed, state, {}, {0.021, 0.023, 0.01}, {0.021, 0.023, -0.002}, 0.5, kNothing);
  const Vec3d held = move(bed, state, {}, tip, tip, 0.5, kNothing);
  ASSERT_EQ(state.mode, ContactMode::stick);
  EXPECT_LT(norm(bed.contact_point(state) - held), 1e-9);
  // Static force: three springs of the corners, displaced as the bary-weighted point demands: k / sum(b^2) *
  // depth.
  const double stiffness = Bed::kStiffness_N_m / dot(state.barycentric, state.barycentric);
  EXPECT_NEAR(-state.force_N.z, stiffness * 0.002, 1e-3 * stiffness * 0.002);
}

TEST(Contact, ATipWithRadiusTouchesEarlier) {
  Bed bed;
  ContactState<double> state;
  constexpr double kRadius_m = 0.004;
  double touched_at_m = -1;
  move(bed, state, {kRadius_m}, {0.021, 0.023, 0.01}, {0.021, 0.023, 0.002}, 0.5, [&](const Vec3d& tip) {
    if (state.mode != ContactMode::free && touched_at_m < 0) touched_at_m = tip.z;
  });
  EXPECT_NEAR(touched_at_m, kRadius_m, 1e-5);
}

// Solves of 3x3 systems of condition 1, and unit vectors, in double.
constexpr double kExact = 1e-12;

double pressing_N(const ContactState<double>& state) {
  return -dot(state.force_N, state.normal);
}
double along_N(const ContactState<double>& state) {
  return norm(state.force_N + state.normal * pressing_N(state));
}

TEST(Contact, DragWithFrictionKeepsTheConeAndCrossesTriangles) {
  constexpr double kFriction = 0.5;
  Bed bed({kFriction, kFriction});
  ContactState<double> state;
  const ContactLaw<double> law{};
  Vec3d tip = move(bed, state, law, {0.012, 0.023, 0.005}, {0.012, 0.023, -0.001}, 0.3, kNothing);
  int slipping = 0;
  std::uint32_t changes = 0, last = state.triangle;
  move(bed, state, law, tip, {0.042, 0.024, -0.001}, 1.0, [&](const Vec3d&) {
    ASSERT_NE(state.mode, ContactMode::free);
    EXPECT_GT(pressing_N(state), 0.0);
    const double cone_N = kFriction * pressing_N(state);
    if (state.mode == ContactMode::slip) {
      EXPECT_NEAR(along_N(state), cone_N, kExact * cone_N);
    } else {
      EXPECT_LE(along_N(state), cone_N * (1.0 + kExact));
    }
    slipping += state.mode == ContactMode::slip;
    changes += state.triangle != last;
    last = state.triangle;
  });
  EXPECT_GT(slipping, 5000);
  EXPECT_GE(changes, 4u);
}

// The force is in the normal, and that is the surface's but for its lean (slide.hpp): by at most the height
// over the width of the triangle.
TEST(Contact, FrictionlessDragHasNoTangentialForce) {
  Bed bed({0.0, 0.0});
  ContactState<double> state;
  const ContactLaw<double> law{};
  Vec3d tip = move(bed, state, law, {0.012, 0.023, 0.005}, {0.012, 0.023, -0.001}, 0.3, kNothing);
  ContactState<double> before = state;
  double largest_lean = 0;
  move(bed, state, law, tip, {0.042, 0.023, -0.001}, 1.0, [&](const Vec3d&) {
    ASSERT_EQ(state.mode, ContactMode::slip);
    EXPECT_LE(along_N(state), kExact * pressing_N(state));
    const auto corner = bed.corners(before.triangle);
    const Vec3d a = bed.position_before(corner[0]);
    const double width_m =
        std::sqrt(norm(cross(bed.position_before(corner[1]) - a, bed.position_before(corner[2]) - a)));
    const double lean = norm(state.normal - bed.normal_before(before.triangle, before.barycentric));
    EXPECT_LE(lean, std::abs(before.height_m) / width_m + kExact);
    largest_lean = std::max(largest_lean, lean);
    before = state;
  });
  EXPECT_GT(largest_lean, 1e-4);  // it does lean
}

TEST(Contact, PullingAwaySeparatesAndTouchesAgain) {
  Bed bed;
  ContactState<double> state;
  const ContactLaw<double> law{};
  Vec3d tip = move(bed, state, law, {0.021, 0.023, 0.01}, {0.021, 0.023, -0.002}, 0.3, kNothing);
  EXPECT_NE(state.mode, ContactMode::free);
  tip = move(bed, state, law, tip, {0.021, 0.023, 0.01}, 0.3,
             [&](const Vec3d&) { EXPECT_LE(state.force_N.z, 0.0); });  // never pulls
  EXPECT_EQ(state.mode, ContactMode::free);
  move(bed, state, law, tip, {0.021, 0.023, -0.002}, 0.3, kNothing);
  EXPECT_EQ(state.mode, ContactMode::stick);
}

TEST(Contact, AFastTipDoesNotTunnel) {
  Bed bed;
  ContactState<double> state;
  // 5 m/s: half a millimetre a step here, and once in a single step of 2 cm.
  step_contact(bed, state, {}, Vec3d{0.021, 0.023, 0.01}, Vec3d{0.022, 0.023, -0.01});
  EXPECT_EQ(state.mode, ContactMode::stick);
  EXPECT_GT(-state.force_N.z, 0.0);
}

TEST(Contact, BesideTheSurfaceThereIsNoContact) {
  Bed bed;
  ContactState<double> state;
  move(bed, state, {}, {-0.005, 0.023, 0.01}, {-0.005, 0.023, -0.01}, 0.2,
       [&](const Vec3d&) { EXPECT_EQ(state.mode, ContactMode::free); });
}

// The tip of a hand that holds still is met without force, and pressed with the bound at most.
TEST(Contact, ATipThatStartsInsideIsPushedOutWithABoundedForce) {
  Bed bed;
  ContactState<double> state;
  constexpr double kDepth_m = 0.008;
  const Vec3d held{0.021, 0.023, -kDepth_m};
  step_contact(bed, state, {}, held, held);
  EXPECT_EQ(state.mode, ContactMode::stick);
  EXPECT_NEAR(state.inset_m, kDepth_m - kPushOut_m_s * Bed::kStep_s, 1e-12);
  double largest_N = 0, before_m = state.inset_m;
  move(bed, state, {}, held, held, 1.0, [&](const Vec3d&) {
    // What presses is bounded; friction of 1 may add as much along the surface.
    EXPECT_LE(pressing_N(state), kPushOut_N);
    EXPECT_LE(along_N(state), pressing_N(state) * (1.0 + kExact));
    largest_N = std::max(largest_N, pressing_N(state));
    EXPECT_LE(before_m - state.inset_m, kPushOut_m_s * Bed::kStep_s * (1 + 1e-9));
    before_m = state.inset_m;
  });
  // The bed's springs would hold much more than that at this depth. They give way until they and the dampers,
  // at the speed of drawing, hold the bound.
  const double weight = dot(state.barycentric, state.barycentric);
  const double held_m = kDepth_m - kPushOut_N * weight / Bed::kStiffness_N_m;
  const double damped_m = Bed::kDamping_N_s_m * kPushOut_m_s / Bed::kStiffness_N_m;
  EXPECT_GE(state.inset_m, held_m);
  EXPECT_LE(state.inset_m, held_m + damped_m + kPushOut_m_s * Bed::kStep_s);
  // It was drawn until one step more at that speed would have been too much for the springs.
  EXPECT_GT(largest_N, kPushOut_N - kPushOut_m_s * Bed::kStep_s * Bed::kStiffness_N_m / weight);
}

// A hand that gives way is led out, and touches from outside as ever afterwards.
TEST(Contact, ATipThatStartsInsideComesOut) {
  Bed bed;
  ContactState<double> state;
  constexpr double kMass_kg = 0.2, kDamping_N_s_m = 5.0, kStart_m = -0.004;
  Vec3d tip{0.021, 0.023, kStart_m}, velocity{};
  bool came_out = false;
  for (int i = 0; i < 30000 && !came_out; ++i) {
    velocity += (state.force_N * -1.0 - velocity * kDamping_N_s_m) * (Bed::kStep_s / kMass_kg);
    const Vec3d next = tip + velocity * Bed::kStep_s;
    step_contact(bed, state, {}, tip, next);
    tip = next;
    if (state.mode != ContactMode::free) {
      // Nothing but the pushing-out acts, and friction of 1.
      EXPECT_LE(pressing_N(state), kPushOut_N);
      EXPECT_LE(along_N(state), pressing_N(state) * (1.0 + kExact));
    }
    came_out = state.mode == ContactMode::free && state.outside;
  }
  EXPECT_TRUE(came_out);
  EXPECT_GT(tip.z, -1e-3);
  tip = move(bed, state, {}, tip, {0.021, 0.023, 0.005}, 0.2, kNothing);
  EXPECT_EQ(state.mode, ContactMode::free);
  move(bed, state, {}, tip, {0.021, 0.023, -0.002}, 0.2, kNothing);
  EXPECT_EQ(state.mode, ContactMode::stick);
  EXPECT_EQ(state.inset_m, 0.0);
}

// Pushed further in from inside, the tip feels the body resist that motion: what it would feel from the
// surface on, and the pushing-out.
TEST(Contact, PushedFurtherInATipThatStartsInsideFeelsTheBody) {
  Bed bed;
  ContactState<double> state;
  constexpr double kStart_m = -0.003, kFurther_m = 0.004;
  Vec3d tip =
      move(bed, state, {}, {0.021, 0.023, kStart_m}, {0.021, 0.023, kStart_m - kFurther_m}, 0.3, kNothing);
  move(bed, state, {}, tip, tip, 0.5, kNothing);
  const double stiffness_N_m = Bed::kStiffness_N_m / dot(state.barycentric, state.barycentric);
  const double drawn_m = -kStart_m - state.inset_m;
  EXPECT_GE(drawn_m, 0.0);
  EXPECT_NEAR(-state.force_N.z, stiffness_N_m * (kFurther_m + drawn_m), 0.01 * stiffness_N_m * kFurther_m);
  EXPECT_GT(-state.force_N.z, kPushOut_N);
}

// A tip that goes out by itself takes what is left of its start inside with it, without a force.
TEST(Contact, GoingOutFromInsideIsFree) {
  Bed bed;
  ContactState<double> state;
  move(bed, state, {}, {0.021, 0.023, -0.005}, {0.021, 0.023, 0.003}, 0.1, [&](const Vec3d& tip) {
    EXPECT_LE(norm(state.force_N), 1e-9);
    if (state.mode != ContactMode::free) {
      EXPECT_NEAR(state.inset_m, -tip.z, 2e-5) << tip.z;
    }
  });
  EXPECT_EQ(state.mode, ContactMode::free);
  EXPECT_TRUE(state.outside);
}

// A sphere whose centre is outside may overlap the surface at the start as well.
TEST(Contact, ASphereThatOverlapsTheSurfaceIsPushedOut) {
  Bed bed;
  ContactState<double> state;
  const ContactLaw<double> law{.tip_radius_m = 0.004};
  const Vec3d held{0.021, 0.023, 0.001};
  step_contact(bed, state, law, held, held);
  EXPECT_EQ(state.mode, ContactMode::stick);
  EXPECT_NEAR(state.inset_m, 0.003 - kPushOut_m_s * Bed::kStep_s, kExact);
  EXPECT_LE(pressing_N(state), kPushOut_N);
  EXPECT_EQ(along_N(state), 0.0);
}

TEST(Contact, CollisionTimeIsFoundWithinTheStep) {
  Bed bed({10.0, 10.0});
  ContactState<double> state;
  // The tip moves sideways while it falls: where it crosses z = 0 tells the time of collision.
  step_contact(bed, state, {}, Vec3d{0.021, 0.023, 0.001}, Vec3d{0.025, 0.023, -0.003});
  ASSERT_NE(state.mode, ContactMode::free);
  const auto corner = bed.corners(state.triangle);
  const double x = bed.position_before(corner[0]).x * state.barycentric.x +
                   bed.position_before(corner[1]).x * state.barycentric.y +
                   bed.position_before(corner[2]).x * state.barycentric.z;
  EXPECT_NEAR(x, 0.022, 0.004 / 256);  // a quarter of the way, to the resolution of eight halvings
}

// A plate that the tip meets while both move in straight lines: the plate along its normal, the tip sideways,
// too. The place where it is met tells the time.
TEST(Contact, TheTimeOfCollisionWithAMovingPlaneIsKnownToA256th) {
  constexpr double kHeight_m = 1e-3;
  for (const double plate_m : {-4e-4, 0.0, 7e-4, 1.5e-3}) {  // in the step
    for (const double fall_m : {0.0, 5e-4, 1.2e-3, 3e-3}) {  // of the tip
      if (plate_m + fall_m <= 1.1 * kHeight_m) continue;     // they do not meet
      const double sideways_m = 4e-3;
      // Its damper takes a part of its speed before it moves.
      const double lasting = 1.0 - Bed::kDamping_N_s_m * Bed::kStep_s / Bed::kMass_kg;
      Bed bed({10.0, 10.0}, {0.0, 0.0, plate_m / (lasting * Bed::kStep_s)});
      ContactState<double> state;
      const Vec3d from{0.0212, 0.023, kHeight_m};
      step_contact(bed, state, {}, from, from + Vec3d{sideways_m, 0.0, -fall_m});
      ASSERT_NE(state.mode, ContactMode::free) << plate_m << " " << fall_m;
      const auto corner = bed.corners(state.triangle);
      double x = 0;
      for (std::size_t c = 0; c < 3; ++c) x += bed.position_before(corner[c]).x * state.barycentric[c];
      EXPECT_NEAR((x - from.x) / sideways_m, kHeight_m / (plate_m + fall_m), 1.0 / 256)
          << plate_m << " " << fall_m;
    }
  }
}

// Dragged against its springs the bed sticks up to static friction; once it slips the force drops to kinetic
// friction, and it sticks again only below that.
TEST(Contact, StaticFrictionAboveKinetic) {
  constexpr double kStatic = 0.6, kKinetic = 0.3, kRounding = 1e-9;
  Bed bed({kStatic, kKinetic});
  ContactState<double> state;
  Vec3d tip = move(bed, state, {}, {0.012, 0.023, 0.005}, {0.012, 0.023, -0.001}, 0.3, kNothing);
  move(bed, state, {}, tip, tip, 0.2, kNothing);
  double before_ratio = 0, broke_loose_at = 0, stuck_again_at = -1;
  ContactMode before = state.mode;
  const auto watch = [&](const Vec3d&) {
    ASSERT_NE(state.mode, ContactMode::free);
    const double normal_N = -dot(state.force_N, state.normal);
    const double ratio = norm(state.force_N + state.normal * normal_N) / normal_N;
    if (state.mode == ContactMode::slip) {
      EXPECT_NEAR(ratio, kKinetic, kRounding);
      if (before == ContactMode::stick && broke_loose_at == 0) broke_loose_at = before_ratio;
    } else {
      EXPECT_LE(ratio, (before == ContactMode::stick ? kStatic : kKinetic) + kRounding);
      if (before == ContactMode::slip) stuck_again_at = ratio;
    }
    before = state.mode;
    before_ratio = ratio;
  };
  tip = move(bed, state, {}, tip, {0.022, 0.024, -0.001}, 1.0, watch);
  // 1 um a step, against springs of 300 N/m with 0.3 N and more on them: the ratio grows by less than 1 % in
  // a step.
  EXPECT_NEAR(broke_loose_at, kStatic, 0.01);
  tip = move(bed, state, {}, tip, {0.012, 0.023, -0.001}, 1.0, watch);
  EXPECT_GE(stuck_again_at, 0.0);
}

ContactLaw<double> coupled(double stiffness_N_m, double damping_N_s_m) {
  return {.coupling = {stiffness_N_m, damping_N_s_m}};
}

TEST(CoupledContact, PressedItIsTwoSpringsInSeries) {
  Bed bed;
  ContactState<double> state;
  const ContactLaw<double> law = coupled(500.0, 1.0);
  const Vec3d tip = move(bed, state, law, {0.021, 0.023, 0.01}, {0.021, 0.023, -0.002}, 0.5, kNothing);
  move(bed, state, law, tip, tip, 0.5, kNothing);
  ASSERT_EQ(state.mode, ContactMode::stick);
  const double bed_N_m = Bed::kStiffness_N_m / dot(state.barycentric, state.barycentric);
  const double force_N = 0.002 / (1.0 / bed_N_m + 1.0 / 500.0);
  constexpr double kAtRest = 1e-3;  // what is left of the motion, and the tilt of the triangle
  EXPECT_NEAR(-state.force_N.z, force_N, kAtRest * force_N);
  EXPECT_LE(norm(state.stretch_m - state.force_N * (1.0 / 500.0)), kAtRest * 0.002);
  EXPECT_LE(norm(tip - bed.contact_point(state) - state.stretch_m), kAtRest * 0.002);
}

// With the stiffness the difference from the kinematic contact goes to zero, to first order: ten times the
// stiffness, a tenth of the difference.
TEST(CoupledContact, TheStiffestIsKinematic) {
  const auto press_N = [](const ContactLaw<double>& law) {
    Bed bed;
    ContactState<double> state;
    std::vector<double> force_N;
    move(bed, state, law, {0.021, 0.023, 0.001}, {0.021, 0.023, -0.002}, 0.1,
         [&](const Vec3d&) { force_N.push_back(state.force_N.z); });
    return force_N;
  };
  const std::vector<double> rigid_N = press_N({});
  const auto difference_N = [&](double stiffness_N_m) {
    const std::vector<double> force_N = press_N(coupled(stiffness_N_m, 0.0));
    double sum = 0.0;
    for (std::size_t i = 0; i < rigid_N.size(); ++i) sum += std::abs(force_N[i] - rigid_N[i]);
    return sum / static_cast<double>(rigid_N.size());
  };
  const double soft_N = difference_N(1e7), stiff_N = difference_N(1e8);
  EXPECT_NEAR(soft_N / stiff_N, 10.0, 1.0);
}

TEST(CoupledContact, SlipsWithTheForceOnTheConeAndTheContactPointBehindTheTip) {
  constexpr double kFriction = 0.3, kRounding = 1e-9;
  Bed bed({kFriction, kFriction});
  ContactState<double> state;
  const ContactLaw<double> law = coupled(400.0, 0.5);
  const Vec3d tip = move(bed, state, law, {0.012, 0.023, 0.005}, {0.012, 0.023, -0.001}, 0.3, kNothing);
  int slipping = 0;
  move(bed, state, law, tip, {0.042, 0.024, -0.001}, 1.0, [&](const Vec3d&) {
    const double normal_N = -dot(state.force_N, state.normal);
    const double tangential_N = norm(state.force_N + state.normal * normal_N);
    EXPECT_GE(normal_N, 0.0);
    EXPECT_LE(tangential_N, kFriction * normal_N + kRounding);
    slipping += state.mode == ContactMode::slip;
    EXPECT_LT(state.stretch_m.z, 0.0);
  });
  EXPECT_GT(slipping, 5000);
  EXPECT_GT(state.stretch_m.x, 0.0);
}

// Retracting faster than the damper lets go: the force never pulls, and the contact ends where the tip leaves
// the surface, not before.
TEST(CoupledContact, NeverPullsAndEndsOutside) {
  Bed bed;
  ContactState<double> state;
  const ContactLaw<double> law = coupled(300.0, 5.0);
  Vec3d tip = move(bed, state, law, {0.021, 0.023, 0.001}, {0.021, 0.023, -0.003}, 0.2, kNothing);
  double left_at_m = -1.0;
  tip = move(bed, state, law, tip, {0.021, 0.023, 0.003}, 0.02, [&](const Vec3d& at) {
    EXPECT_LE(state.force_N.z, 0.0);
    if (state.mode == ContactMode::free && left_at_m < 0.0) left_at_m = at.z + 1.0;
  });
  ASSERT_EQ(state.mode, ContactMode::free);
  EXPECT_EQ(state.stretch_m, Vec3d{});
  constexpr double kBedMotion_m = 0.001;  // the bed springs back and swings
  EXPECT_GE(left_at_m, 1.0 - kBedMotion_m);
}

}  // namespace
}  // namespace palpate
