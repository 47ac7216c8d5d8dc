// A local model that arrives late and catches up is the one that it would have been in time: while the tip
// sticks, slips, goes from one triangle to the next, and touches the body for the first time. With springs
// (builder hybrid) and without (builder patch).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "firmware/core/renderer_test_support.hpp"
#include "host/linearize/hybrid_builder.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/msd/vectors.hpp"
#include "host/session/body_surface.hpp"
#include "host/session/model_message.hpp"
#include "host/session/model_replay.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::Path;

constexpr int kSide = 8;
constexpr int kLate_ticks = 20, kTicks = 70;  // after the model's own tick
constexpr double kDepth_m = 0.003;
// Of 1 cm cells; the top at z = 0. Within a triangle, away from the body's sides.
constexpr Vec3d kPlace_m{0.034, 0.0315, 0.0};
constexpr double kMiddle_rad_s = 2.0 * std::numbers::pi * 20.0;

Path press() {
  Path path(kPlace_m + Vec3d{0, 0, 5e-4});
  path.to(kPlace_m + Vec3d{0, 0, -kDepth_m}, 250).hold(50);
  return path;
}

struct Situation {
  std::string name;
  Friction<double> friction;
  std::uint32_t made;  // the model's own tick
  Path path;
  // Largest error of a hybrid model against the body, of the largest force. Stated before it was measured: a
  // press askew has 1 % (hybrid_model_test.cpp); in a slip and over an edge the springs that are exact
  // change, and a force at first contact is small while the body gives way as a whole.
  double bound;
};

std::vector<Situation> situations() {
  const Vec3d down_m = kPlace_m + Vec3d{0, 0, -kDepth_m};
  Path stick = press(), slip = press(), edge = press(), first(kPlace_m + Vec3d{0, 0, 5e-4});
  stick.to(down_m + Vec3d{0.001, 0.0005, -0.0005}, 100).hold(50);
  slip.to(down_m + Vec3d{0.005, 0.0, 0.0}, 150);
  edge.to(down_m + Vec3d{0.0, 0.012, 0.0}, 300);
  first.to(kPlace_m + Vec3d{0, 0, -0.002}, 160);
  return {{"stick", {8.0, 8.0}, 310, stick, 0.01},
          {"slip", {0.4, 0.3}, 370, slip, 0.03},
          {"edge", {0.4, 0.3}, 390, edge, 0.03},
          {"first contact", {0.5, 0.5}, 40, first, 0.05}};
}

// The body, followed to the model's tick; then the model.
class Late {
 public:
  Late(const Situation& situation, bool hybrid)
      : situation_(situation),
        surface_(body_, body_.rest_state(), 1e-4, SurfaceKind::smooth, {},
                 {.elsewhere = situation.friction, .regions = {}}) {
    for (std::uint32_t t = 1; t <= situation.made; ++t) (void)body_force_N(t);
    start_ = contact_;
    const SurfacePoint point =
        contact_.mode == ContactMode::free
            ? nearest_surface_point(body_, surface_.state().position_m, to_eigen(tip(situation.made)))
            : SurfacePoint{static_cast<int>(contact_.triangle), to_eigen(contact_.barycentric)};
    LocalModel model;
    if (hybrid) {
      HybridBuilder builder(body_, {}, 12, {kMiddle_rad_s}, kTick_s);
      model = builder.build(surface_.state(), point, {});
    } else {
      model = build_patch(body_, surface_.state(), point, {}, kTick_s);
    }
    nodes_ = model.node;
    pack_model(model, {1, situation.made, 1000, TipSource::counts, ModelKind::modes}, {}, SurfaceKind::smooth,
               surface_.friction(), contact_, *contents_);
    packed_ = wire::pack(*contents_);
  }
  Vec3d body_force_N(std::uint32_t t) {
    return advance_tick(surface_, contact_, {}, tip(t - 1), tip(t)).mean_force_N;
  }
  [[nodiscard]] Vec3d tip(std::uint32_t t) const { return situation_.path.tip_m[t]; }

  const Situation& situation_;
  Body body_ = test::block(kSide);
  BodySurface surface_;
  ContactState<double> contact_, start_;
  std::vector<int> nodes_;
  std::unique_ptr<wire::ModelContents> contents_ = std::make_unique<wire::ModelContents>();
  wire::PackedModel packed_;
};

struct Outcome {
  std::uint32_t taken = 0;  // first tick that the late one was rendered in
  // Of the ticks after the model's own:
  std::vector<firmware::ServoSample> late;
  std::vector<Vec3f> late_barycentric;
  std::vector<ContactState<float>> prompt;
  std::vector<Vec3d> body_N;
};

// What is compared: rendered by a board that hears of the model kLate_ticks after its tick; in time, with the
// near field as seldom as the board computes it until the other has caught up; and the body itself.
Outcome render(Late& late) {
  const std::uint32_t made = late.situation_.made;
  const auto renderer = std::make_unique<firmware::Renderer>(wire::kSchemaHash, firmware::kCatchUpCortexM4);
  const auto narrow_tip = [&](std::uint32_t t) { return narrow(late.tip(t)); };
  firmware::test::Reference prompt(*late.contents_, narrow_tip(made));
  prompt.set_near_period(firmware::kCatchUpCortexM4.near_period_steps);
  Outcome outcome;
  firmware::ModelReport report;
  (void)renderer->isr_tick(made, narrow_tip(made));
  for (std::uint32_t t = made + 1; t <= made + kTicks; ++t) {
    outcome.late.push_back(renderer->isr_tick(t, narrow_tip(t)));
    outcome.late_barycentric.push_back(renderer->contact_barycentric());
    if (outcome.taken == 0 && renderer->model_sequence() != 0) {
      outcome.taken = t;
      prompt.set_near_period(kNearPeriod_steps);
    }
    outcome.prompt.push_back(prompt.step(narrow_tip(t)));
    outcome.body_N.push_back(late.body_force_N(t));
    if (t == made + kLate_ticks) {
      EXPECT_EQ(firmware::test::deliver(*renderer, *late.contents_, report), Status::ok);
    }
    (void)renderer->catch_up(report);
  }
  return outcome;
}

class LateModel : public ::testing::TestWithParam<std::tuple<std::size_t, bool>> {
 protected:
  Situation situation_ = situations()[std::get<0>(GetParam())];
  bool hybrid_ = std::get<1>(GetParam());
  Late late_{situation_, hybrid_};
};

TEST_P(LateModel, IsTheOneThatWouldHaveComeInTime) {
  const Outcome o = render(late_);
  const std::uint32_t made = situation_.made;
  ASSERT_GE(o.taken, made + kLate_ticks + 3);
  ASSERT_LE(o.taken, made + kTicks - 15);
  const auto at = [&](const auto& of_ticks, std::uint32_t t) -> const auto& {
    return of_ticks[t - made - 1];
  };
  for (std::uint32_t t = o.taken; t <= made + kTicks; ++t) {
    const firmware::ServoSample& a = at(o.late, t);
    const ContactState<float>& b = at(o.prompt, t);
    ASSERT_EQ(a.force_N, b.force_N) << t;
    ASSERT_EQ(a.mode, b.mode) << t;
    ASSERT_EQ(a.triangle, late_.contents_->triangle_id.elements[b.triangle]) << t;
    ASSERT_EQ(at(o.late_barycentric, t), b.barycentric) << t;
  }
  // The situation is what it is called, where the model catches up and where it is taken over.
  const ContactState<float>& before = at(o.prompt, o.taken - 1);
  const firmware::ServoSample& now = at(o.late, o.taken);
  ASSERT_NE(now.mode, ContactMode::free);
  if (situation_.name == "stick") {
    EXPECT_EQ(late_.start_.mode, ContactMode::stick);
    EXPECT_EQ(now.mode, ContactMode::stick);
  } else if (situation_.name == "first contact") {
    EXPECT_EQ(late_.start_.mode, ContactMode::free);
    EXPECT_NE(before.mode, ContactMode::free);
  } else {
    EXPECT_EQ(late_.start_.mode, ContactMode::slip);
    EXPECT_EQ(now.mode, ContactMode::slip);
    EXPECT_NE(before.barycentric, at(o.late_barycentric, o.taken));
    EXPECT_EQ(situation_.name == "edge", now.triangle != late_.start_.triangle);
  }
}

// A patch alone is too stiff: docs/decisions/whole_body.md.
class LateHybrid : public LateModel {};

TEST_P(LateHybrid, FollowsTheBody) {
  const Outcome o = render(late_);
  ASSERT_NE(o.taken, 0u);
  double largest_N = 0, error_N = 0;
  for (std::size_t i = o.taken - situation_.made - 1; i < o.late.size(); ++i) {
    largest_N = std::max(largest_N, norm(o.body_N[i]));
    error_N = std::max(error_N, norm(widen(o.late[i].force_N) - o.body_N[i]));
  }
  EXPECT_LT(error_N, situation_.bound * largest_N) << "bound " << situation_.bound * largest_N << " N";
}

// Places that cross the wire are counted in steps (ModelState): each coordinate is off by half of one at
// most, and by what single precision leaves of places within 10 cm.
TEST_P(LateModel, HasItsNodesWithinHalfAStep) {
  const ModelReplay replay(late_.packed_, narrow(late_.tip(situation_.made)));
  const palpate_ModelState_1_0& state = late_.packed_.state;
  const double modal_m = 0.5 * static_cast<double>(state.q_step_m) * late_.contents_->modes;
  const double bound_m = 0.5 * static_cast<double>(state.displacement_step_m) + modal_m + 2e-8;
  double largest_m = 0;
  for (std::size_t n = 0; n < late_.nodes_.size(); ++n) {
    const Eigen::Vector3d off =
        replay.surface_node_m(n) - late_.surface_.state().position_m.col(late_.nodes_[n]);
    largest_m = std::max(largest_m, off.cwiseAbs().maxCoeff());
  }
  EXPECT_LE(largest_m, bound_m);
  EXPECT_LT(bound_m, 1e-6);
}

std::string name_of(const ::testing::TestParamInfo<std::tuple<std::size_t, bool>>& given) {
  std::string name = situations()[std::get<0>(given.param)].name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name + (std::get<1>(given.param) ? "_hybrid" : "_patch");
}

INSTANTIATE_TEST_SUITE_P(All, LateModel,
                         ::testing::Combine(::testing::Range<std::size_t>(0, 4), ::testing::Bool()), name_of);
INSTANTIATE_TEST_SUITE_P(All, LateHybrid,
                         ::testing::Combine(::testing::Range<std::size_t>(0, 4), ::testing::Values(true)),
                         name_of);

}  // namespace
}  // namespace palpate::host
