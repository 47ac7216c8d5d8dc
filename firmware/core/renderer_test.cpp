#include "firmware/core/renderer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "firmware/test_support.hpp"
#include "shared/contact/contact.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::firmware {
namespace {

using test::HostPeer;
using test::square_model;

constexpr Vec3f kCentre_m{0.001f, -0.002f, 0.003f};
constexpr std::uint8_t kModelUsed = palpate_ServoSample_1_0_FLAG_MODEL_USED,
                       kModelSwap = palpate_ServoSample_1_0_FLAG_MODEL_SWAP;

// Down onto the square, a slow circle on it, and up again: every 400 ticks.
Vec3f tip_at(std::uint32_t tick) {
  const float phase = static_cast<float>(tick % 400) / 400.0f;
  const float angle_rad = 6.2831853f * phase;
  return kCentre_m + Vec3f{0.0025f * std::cos(angle_rad), 0.0025f * std::sin(2.0f * angle_rad),
                           0.001f - 0.0025f * std::sin(3.1415927f * phase)};
}

void expect_equal(const ServoSample& a, const ServoSample& b, std::uint32_t tick) {
  EXPECT_EQ(a.tip_m, b.tip_m) << tick;
  EXPECT_EQ(a.force_N, b.force_N) << tick;
  EXPECT_EQ(a.mode, b.mode) << tick;
  EXPECT_EQ(a.flags, b.flags) << tick;
  EXPECT_EQ(a.triangle, b.triangle) << tick;
  EXPECT_EQ(a.barycentric, b.barycentric) << tick;
}

// The model of a message, stepped directly.
class Reference {
 public:
  Reference(const palpate_LocalModel_1_0& message, const Vec3f& tip_m)
      : message_(std::make_unique<palpate_LocalModel_1_0>(message)) {
    const palpate_LocalModel_1_0& m = *message_;
    view_ = wire::view_of(m);
    std::copy_n(m.state_q.elements, m.modes, state_.q.begin());
    std::copy_n(m.state_p.elements, m.modes, state_.p.begin());
    surface_.bind(view_, state_);
    previous_m_ = tip_m - view_.origin_m;
  }
  const ContactState<float>& step(const Vec3f& tip_m) {
    const ContactLaw<float> law{
        .tip_radius_m = message_->tip_radius_m,
        .coupling = {message_->coupling_stiffness_N_m, message_->coupling_damping_N_s_m}};
    step_contact(surface_, contact_, law, previous_m_, tip_m - view_.origin_m);
    previous_m_ = tip_m - view_.origin_m;
    return contact_;
  }
  // The model with the state and the contact that it has now.
  palpate_LocalModel_1_0 as_it_is(std::uint32_t sequence, std::uint32_t tick) const {
    palpate_LocalModel_1_0 m = *message_;
    m.sequence = sequence;
    m.tick = tick;
    for (std::size_t i = 0; i < m.modes; ++i) {
      m.state_q.elements[i] = state_.q[i];
      m.state_p.elements[i] = state_.p[i];
    }
    m.contact.mode = static_cast<std::uint8_t>(contact_.mode);
    m.contact.triangle = m.triangle_id.elements[contact_.triangle];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      m.contact.barycentric[axis] = contact_.barycentric[axis];
      m.contact.force_N[axis] = contact_.force_N[axis];
      m.contact.coupling_stretch_m[axis] = contact_.stretch_m[axis];
    }
    m.contact.height_m = contact_.height_m;
    return m;
  }

 private:
  std::unique_ptr<palpate_LocalModel_1_0> message_;
  LocalModelView view_{};
  ModalState state_{};
  ModalSurface surface_{};
  ContactState<float> contact_{};
  Vec3f previous_m_{};
};

// A renderer with its two contexts in turn.
struct Runner {
  // Interrupt, then background; the tick's sample.
  ServoSample tick() {
    const ServoSample sample = renderer->isr_tick(now, tip_at(now));
    ++now;
    ModelReport report;
    if (renderer->catch_up(report)) reports.push_back(report);
    return sample;
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) (void)tick();
  }
  Status accept(const palpate_LocalModel_1_0& message) { return accept(HostPeer::payload(message)); }
  Status accept(const std::vector<std::uint8_t>& payload) {
    ModelReport report;
    const Status status = renderer->accept(payload, report);
    if (status != Status::ok) reports.push_back(report);
    return status;
  }

  std::unique_ptr<Renderer> renderer = std::make_unique<Renderer>(wire::kSchemaHash);
  std::uint32_t now = 0;  // the next tick
  std::vector<ModelReport> reports;
};

TEST(Renderer, WithoutAModelThereIsNoForce) {
  Runner runner;
  for (int i = 0; i < 500; ++i) {
    const ServoSample sample = runner.tick();
    EXPECT_EQ(sample.force_N, Vec3f{});
    EXPECT_EQ(sample.mode, ContactMode::free);
    EXPECT_EQ(sample.flags, 0);
  }
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  EXPECT_EQ(runner.renderer->model_age_ticks(), 0u);
  EXPECT_EQ(runner.renderer->model_valid_ticks(), 0u);
}

// Neither the model's age on arrival nor the swap leaves a trace in the force.
TEST(Renderer, AModelIsRenderedAsIfItHadBeenThereFromItsTickOn) {
  for (const std::uint32_t age_ticks : {0u, 1u, 30u, 120u}) {
    Runner runner;
    runner.ticks(200);
    const std::uint32_t model_tick = runner.now - 1 - age_ticks;
    const auto message = square_model(9, model_tick, kCentre_m);
    Reference reference(message, tip_at(model_tick));
    for (std::uint32_t tick = model_tick + 1; tick < runner.now; ++tick) (void)reference.step(tip_at(tick));
    ASSERT_EQ(runner.accept(message), Status::ok);

    std::uint32_t swap_tick = 0, contact_ticks = 0;
    for (int i = 0; i < 800; ++i) {
      const std::uint32_t tick = runner.now;
      const ServoSample sample = runner.tick();
      const ContactState<float>& expected = reference.step(tip_at(tick));
      if ((sample.flags & kModelSwap) != 0) {
        EXPECT_EQ(swap_tick, 0u);
        swap_tick = tick;
      }
      EXPECT_EQ((sample.flags & kModelUsed) != 0, swap_tick != 0);
      if (swap_tick == 0) continue;
      EXPECT_EQ(sample.force_N, expected.force_N) << "tick " << tick;
      EXPECT_EQ(sample.mode, expected.mode);
      EXPECT_EQ(runner.renderer->model_age_ticks(), tick - model_tick);
      EXPECT_EQ(runner.renderer->contact_normal(),
                expected.mode == ContactMode::free ? Vec3f{} : expected.normal);
      if (expected.mode == ContactMode::free) continue;
      ++contact_ticks;
      EXPECT_EQ(sample.barycentric, expected.barycentric);
      EXPECT_EQ(sample.triangle, message.triangle_id.elements[expected.triangle]);
    }
    ASSERT_NE(swap_tick, 0u);
    EXPECT_GT(contact_ticks, 100u);
    ASSERT_EQ(runner.reports.size(), 1u);
    EXPECT_EQ(runner.reports[0].status, Status::ok);
    EXPECT_EQ(runner.reports[0].sequence, 9u);
    EXPECT_EQ(runner.reports[0].model_tick, model_tick);
    EXPECT_EQ(runner.reports[0].swap_tick, swap_tick);
    EXPECT_EQ(runner.renderer->model_sequence(), 9u);
    EXPECT_EQ(runner.renderer->model_valid_ticks(), 1000u);
    EXPECT_EQ(runner.renderer->catch_up_ticks(), 0u);
  }
}

TEST(Renderer, AModelThatHasTheContactGoesOnFromIt) {
  Runner runner;
  runner.ticks(100);
  auto message = square_model(3, runner.now - 1, tip_at(runner.now - 1) + Vec3f{0.0f, 0.0f, 0.0005f});
  message.contact.mode = palpate_Contact_1_0_MODE_STICK;
  message.contact.triangle = 9;
  for (float& weight : message.contact.barycentric) weight = 1.0f / 3.0f;
  ASSERT_EQ(runner.accept(message), Status::ok);
  ServoSample sample;
  for (int i = 0; i < 20 && (sample.flags & kModelUsed) == 0; ++i) sample = runner.tick();
  EXPECT_NE(sample.mode, ContactMode::free);
  EXPECT_LT(sample.force_N.z, 0.0f);
}

// The coupling is stretched when one model takes over from another, 40 ticks late: it goes on as it was.
TEST(Renderer, ASwapKeepsTheStretchOfTheCoupling) {
  Runner runner;
  runner.ticks(200);
  auto message = square_model(1, runner.now - 1, kCentre_m);
  message.coupling_stiffness_N_m = 800.0f;
  message.coupling_damping_N_s_m = 2.0f;
  Reference reference(message, tip_at(runner.now - 1));
  ASSERT_EQ(runner.accept(message), Status::ok);
  const auto step = [&] {
    const Vec3f expected_N = reference.step(tip_at(runner.now)).force_N;
    const ServoSample sample = runner.tick();
    return (sample.flags & kModelUsed) != 0 ? norm(sample.force_N - expected_N) : 0.0f;
  };
  for (int i = 0; i < 360; ++i) EXPECT_EQ(step(), 0.0f);
  const auto later = reference.as_it_is(2, runner.now - 1);
  ASSERT_NE(later.contact.mode, palpate_Contact_1_0_MODE_FREE);
  const float* stretch_m = later.contact.coupling_stretch_m;
  ASSERT_GT(std::hypot(stretch_m[0], stretch_m[1], stretch_m[2]), 1e-4f);
  for (int i = 0; i < 40; ++i) EXPECT_EQ(step(), 0.0f);
  ASSERT_EQ(runner.accept(later), Status::ok);
  // A node's normal is as old as its model allows (kNormalLifetime_steps), and the new model's are new.
  constexpr float kAgeOfNormals_N = 2e-3f;
  for (int i = 0; i < 40; ++i) EXPECT_LE(step(), kAgeOfNormals_N);
  EXPECT_EQ(runner.renderer->model_sequence(), 2u);
}

struct BadMessage {
  std::string name;
  Status status;
  std::function<void(palpate_LocalModel_1_0&)> spoil;
};

void PrintTo(const BadMessage& bad, std::ostream* out) {
  *out << bad.name;
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();

// A contact with one number spoilt.
template <class Spoil>
auto in_contact(Spoil spoil) {
  return [spoil](palpate_LocalModel_1_0& m) {
    m.contact.mode = palpate_Contact_1_0_MODE_SLIP;
    m.contact.triangle = 9;
    m.contact.barycentric[0] = 1.0f;
    spoil(m.contact);
  };
}

class Refused : public ::testing::TestWithParam<BadMessage> {};

TEST_P(Refused, LeavesTheActiveModelAsItIs) {
  constexpr int kTicks = 600;
  Runner good, bad;
  std::uint32_t contact_ticks = 0;
  for (int i = 0; i < kTicks; ++i) {
    if (i == 250) {
      for (Runner* runner : {&good, &bad})
        ASSERT_EQ(runner->accept(square_model(1, runner->now - 1, kCentre_m)), Status::ok);
    }
    if (i >= 300 && i % 37 == 0) {
      auto message = square_model(77, bad.now - 5, kCentre_m + Vec3f{0.0f, 0.0f, 0.001f});
      GetParam().spoil(message);
      (void)bad.accept(message);
    }
    const std::uint32_t tick = good.now;
    const ServoSample expected = good.tick();
    expect_equal(bad.tick(), expected, tick);
    contact_ticks += tick > 320 && expected.mode != ContactMode::free;
  }
  EXPECT_GT(contact_ticks, 50u);
  ASSERT_EQ(bad.reports.size(), 1u + 8u);  // the good one's; ticks 333, 370, ... 592
  EXPECT_EQ(bad.reports[0].status, Status::ok);
  for (std::size_t i = 1; i < bad.reports.size(); ++i) {
    EXPECT_EQ(bad.reports[i].status, GetParam().status);
    EXPECT_EQ(bad.reports[i].sequence, 77u);
    EXPECT_EQ(bad.reports[i].swap_tick, 0u);
    EXPECT_NE(bad.reports[i].model_tick, 0u);
  }
  EXPECT_EQ(bad.renderer->model_sequence(), 1u);
  EXPECT_EQ(bad.renderer->catch_up_ticks(), 0u);
}

INSTANTIATE_TEST_SUITE_P(
    Messages, Refused,
    ::testing::Values(
        BadMessage{"schema", Status::schema_mismatch, [](auto& m) { m.schema_hash ^= 1; }},
        BadMessage{"nan_in_coefficient", Status::model_not_finite,
                   [](auto& m) { m.coefficient.elements[7] = kNan; }},
        BadMessage{"nan_in_state", Status::model_not_finite, [](auto& m) { m.state_p.elements[11] = kNan; }},
        BadMessage{"infinite_load", Status::model_not_finite,
                   [](auto& m) { m.load.elements[0] = kInfinity; }},
        BadMessage{"nan_in_origin", Status::model_not_finite, [](auto& m) { m.origin_m[1] = kNan; }},
        BadMessage{"nan_in_contact", Status::model_not_finite,
                   [](auto& m) {
                     m.contact.mode = palpate_Contact_1_0_MODE_STICK;
                     m.contact.triangle = 9;
                     m.contact.barycentric[2] = kNan;
                   }},
        BadMessage{"infinite_height", Status::model_not_finite,
                   [](auto& m) {
                     m.contact.mode = palpate_Contact_1_0_MODE_SLIP;
                     m.contact.triangle = 9;
                     m.contact.barycentric[0] = 1.0f;
                     m.contact.height_m = -kInfinity;
                   }},
        BadMessage{"too_many_modes", Status::model_too_large, [](auto& m) { m.modes = kMaxModes + 1; }},
        BadMessage{"too_many_nodes", Status::model_too_large,
                   [](auto& m) { m.nodes = kMaxSurfaceNodes + 1; }},
        BadMessage{"too_many_triangles", Status::model_too_large,
                   [](auto& m) { m.triangles = kMaxTriangles + 1; }},
        BadMessage{"missing_mode", Status::model_inconsistent, [](auto& m) { --m.load.count; }},
        BadMessage{"missing_basis", Status::model_inconsistent, [](auto& m) { m.basis.count -= 12; }},
        BadMessage{"fewer_modes_than_said", Status::model_inconsistent, [](auto& m) { --m.modes; }},
        BadMessage{"corner_out_of_range", Status::model_inconsistent,
                   [](auto& m) { m.corner.elements[5] = 4; }},
        BadMessage{"unknown_triangle", Status::model_inconsistent,
                   [](auto& m) {
                     m.contact.mode = palpate_Contact_1_0_MODE_SLIP;
                     m.contact.triangle = 8;
                   }},
        BadMessage{"negative_inset", Status::model_inconsistent,
                   [](auto& m) {
                     m.contact.mode = palpate_Contact_1_0_MODE_SLIP;
                     m.contact.triangle = 9;
                     m.contact.barycentric[0] = 1.0f;
                     m.contact.inset_m = -0.001f;
                   }},
        BadMessage{"nan_in_overhang", Status::model_not_finite,
                   [](auto& m) {
                     m.contact.mode = palpate_Contact_1_0_MODE_SLIP;
                     m.contact.triangle = 9;
                     m.contact.barycentric[0] = 1.0f;
                     m.contact.overhang_m[1] = kNan;
                   }},
        BadMessage{"unknown_mode", Status::model_inconsistent, [](auto& m) { m.contact.mode = 3; }},
        BadMessage{"negative_friction", Status::model_inconsistent,
                   [](auto& m) { m.kinetic_friction.elements[0] = m.static_friction.elements[0] = -0.1f; }},
        BadMessage{"nan_friction", Status::model_inconsistent,
                   [](auto& m) { m.static_friction.elements[0] = kNan; }},
        BadMessage{"infinite_friction", Status::model_inconsistent,
                   [](auto& m) { m.static_friction.elements[0] = kInfinity; }},
        BadMessage{"kinetic_above_static", Status::model_inconsistent,
                   [](auto& m) { m.kinetic_friction.elements[0] = 0.6f; }},
        BadMessage{"frictions_without_partner", Status::model_inconsistent,
                   [](auto& m) { m.static_friction.count = 2; }},
        BadMessage{"no_friction", Status::model_inconsistent,
                   [](auto& m) { m.static_friction.count = m.kinetic_friction.count = 0; }},
        BadMessage{"unknown_friction", Status::model_inconsistent,
                   [](auto& m) { m.triangle_friction.elements[1] = 1; }},
        BadMessage{"triangle_without_friction", Status::model_inconsistent,
                   [](auto& m) { --m.triangle_friction.count; }},
        BadMessage{"nan_in_stretch", Status::model_not_finite,
                   in_contact([](auto& c) { c.coupling_stretch_m[2] = kNan; })},
        BadMessage{"long_stretch", Status::model_inconsistent,
                   in_contact([](auto& c) { c.coupling_stretch_m[2] = 1.1f; })},
        BadMessage{"nan_inset", Status::model_not_finite, in_contact([](auto& c) { c.inset_m = kNan; })},
        BadMessage{"deep_inset", Status::model_inconsistent, in_contact([](auto& c) { c.inset_m = 1e20f; })},
        BadMessage{"long_overhang", Status::model_inconsistent,
                   in_contact([](auto& c) { c.overhang_m[0] = -3e38f; })},
        BadMessage{"large_height", Status::model_inconsistent,
                   in_contact([](auto& c) { c.height_m = -1.1f; })},
        BadMessage{"unknown_tip_source", Status::model_inconsistent, [](auto& m) { m.tip_source = 2; }},
        BadMessage{"negative_stiffness", Status::model_inconsistent,
                   [](auto& m) { m.coupling_stiffness_N_m = -1.0f; }},
        BadMessage{"nan_stiffness", Status::model_inconsistent,
                   [](auto& m) { m.coupling_stiffness_N_m = kNan; }},
        BadMessage{"tiny_stiffness", Status::model_inconsistent,
                   [](auto& m) { m.coupling_stiffness_N_m = std::numeric_limits<float>::denorm_min(); }},
        BadMessage{"large_stiffness", Status::model_inconsistent,
                   [](auto& m) { m.coupling_stiffness_N_m = 2e6f; }},
        BadMessage{"negative_damping", Status::model_inconsistent,
                   [](auto& m) { m.coupling_damping_N_s_m = -1.0f; }},
        BadMessage{"nan_damping", Status::model_inconsistent,
                   [](auto& m) { m.coupling_damping_N_s_m = kNan; }},
        BadMessage{"large_damping", Status::model_inconsistent,
                   [](auto& m) { m.coupling_damping_N_s_m = 1e20f; }},
        BadMessage{"nan_radius", Status::model_inconsistent, [](auto& m) { m.tip_radius_m = kNan; }},
        BadMessage{"large_radius", Status::model_inconsistent, [](auto& m) { m.tip_radius_m = 0.06f; }},
        BadMessage{"negative_radius", Status::model_inconsistent, [](auto& m) { m.tip_radius_m = -0.001f; }},
        BadMessage{"unknown_surface", Status::model_inconsistent, [](auto& m) { m.surface = 2; }},
        BadMessage{"unknown_kind", Status::model_inconsistent, [](auto& m) { m.kind = 3; }},
        BadMessage{"held_force_with_modes", Status::model_inconsistent,
                   [](auto& m) { m.kind = palpate_LocalModel_1_0_KIND_HELD_FORCE; }},
        BadMessage{"no_horizon", Status::model_inconsistent, [](auto& m) { m.valid_ticks = 0; }},
        BadMessage{"too_old", Status::model_too_old, [](auto& m) { m.tick -= kTipHistory; }},
        BadMessage{"from_the_future", Status::model_from_future, [](auto& m) { m.tick += 500; }}),
    [](const auto& tested) { return tested.param.name; });

palpate_LocalModel_1_0 held_force(std::uint32_t sequence, std::uint32_t tick, float force_N) {
  palpate_LocalModel_1_0 message{};
  message.sequence = sequence;
  message.schema_hash = wire::kSchemaHash;
  message.tick = tick;
  message.valid_ticks = 1000;
  message.kind = palpate_LocalModel_1_0_KIND_HELD_FORCE;
  message.contact.mode = palpate_Contact_1_0_MODE_STICK;
  message.contact.triangle = 4321;
  message.contact.barycentric[1] = 1.0f;
  message.contact.force_N[2] = force_N;
  return message;
}

// Whatever the tip does, and however long ago the force was.
TEST(Renderer, AHeldForceStaysUntilTheNextModel) {
  Runner runner;
  runner.ticks(300);
  ASSERT_EQ(runner.accept(held_force(1, 20, -1.5f)), Status::ok);  // older than the history
  while (runner.renderer->model_sequence() != 1) (void)runner.tick();
  ASSERT_LT(runner.now, 310u);
  for (int i = 0; i < 500; ++i) {
    const ServoSample sample = runner.tick();
    ASSERT_EQ(sample.force_N, (Vec3f{0.0f, 0.0f, -1.5f}));
    ASSERT_EQ(sample.mode, ContactMode::stick);
    ASSERT_EQ(sample.triangle, 4321u);
    ASSERT_EQ(sample.barycentric, (Vec3f{0.0f, 1.0f, 0.0f}));
    ASSERT_EQ(runner.renderer->model_age_ticks(), runner.now - 1 - 20);
  }
  ASSERT_EQ(runner.accept(held_force(2, runner.now - 1, -0.5f)), Status::ok);
  while (runner.renderer->model_sequence() != 2) (void)runner.tick();
  EXPECT_EQ(runner.tick().force_N, (Vec3f{0.0f, 0.0f, -0.5f}));
  ASSERT_EQ(runner.accept(square_model(3, runner.now - 1, kCentre_m)), Status::ok);
  while (runner.renderer->model_sequence() != 3) (void)runner.tick();
  ASSERT_EQ(runner.reports.size(), 3u);
  for (const ModelReport& report : runner.reports) {
    EXPECT_EQ(report.status, Status::ok);
    EXPECT_GT(report.swap_tick, report.model_tick);
  }
}

TEST(Renderer, AHeldForceIsANumber) {
  Runner runner;
  runner.ticks(100);
  EXPECT_EQ(runner.accept(held_force(1, 50, kNan)), Status::model_not_finite);
  ASSERT_EQ(runner.accept(held_force(2, 400, 1.0f)), Status::ok);
  runner.ticks(5);
  EXPECT_EQ(runner.reports.back().status, Status::model_from_future);
}

// Leftovers of a contact in the message of a tip that is free do not reach the force.
TEST(Renderer, AFreeTipHasNoOffsets) {
  Runner clean, littered;
  for (Runner* runner : {&clean, &littered}) {
    runner->ticks(100);
    auto message = square_model(1, runner->now - 1, kCentre_m);
    message.coupling_stiffness_N_m = 800.0f;
    if (runner == &littered) {
      message.contact.coupling_stretch_m[2] = -0.003f;
      message.contact.inset_m = kNan;
      message.contact.overhang_m[0] = 0.01f;
      message.contact.height_m = 0.004f;
    }
    ASSERT_EQ(runner->accept(message), Status::ok);
  }
  int contact_ticks = 0;
  for (int i = 0; i < 400; ++i) {
    const std::uint32_t tick = clean.now;
    const ServoSample expected = clean.tick();
    expect_equal(littered.tick(), expected, tick);
    contact_ticks += expected.mode != ContactMode::free;
  }
  EXPECT_GT(contact_ticks, 50);
}

// A model that is not rolled forward takes the state of its own tick for the present one.
TEST(Renderer, AModelFromNowBeginsWhenItIsTakenOver) {
  Runner runner;
  runner.ticks(395);
  auto message = square_model(9, 300, kCentre_m);
  message.kind = palpate_LocalModel_1_0_KIND_MODES_FROM_NOW;
  message.state_p.elements[0] = 1e-3f;
  ASSERT_EQ(runner.accept(message), Status::ok);
  ServoSample sample;
  do sample = runner.tick();
  while ((sample.flags & kModelSwap) == 0 && runner.now < 415);
  ASSERT_LT(runner.now, 401u);
  Reference reference(message, tip_at(runner.now - 2));
  for (int i = 0; i < 400; ++i) {
    const ContactState<float>& expected = reference.step(tip_at(runner.now - 1));
    ASSERT_EQ(sample.force_N, expected.force_N) << runner.now;
    ASSERT_EQ(sample.mode, expected.mode);
    sample = runner.tick();
  }
}

TEST(Renderer, AnArrayBeyondItsBoundIsTooLarge) {
  Runner runner;
  runner.ticks(100);
  const auto message = square_model(5, 50, kCentre_m);
  std::vector<std::uint8_t> payload = HostPeer::payload(message);
  // The length of the array of positions comes right after the contact.
  constexpr std::size_t kPositionCount = 109;
  ASSERT_EQ(payload[kPositionCount], 12);
  payload[kPositionCount] = 97;
  EXPECT_EQ(runner.accept(payload), Status::model_too_large);
  ASSERT_EQ(runner.reports.size(), 1u);
  EXPECT_EQ(runner.reports[0].sequence, 5u);
  EXPECT_EQ(runner.reports[0].model_tick, 50u);
}

TEST(Renderer, ATruncatedPayloadIsRefused) {
  Runner runner;
  runner.ticks(100);
  const std::vector<std::uint8_t> payload = HostPeer::payload(square_model(5, 50, kCentre_m));
  for (std::size_t length = 0; length < payload.size(); length += 7) {
    EXPECT_NE(
        runner.accept(std::vector(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(length))),
        Status::ok)
        << length;
  }
  EXPECT_EQ(runner.accept(payload), Status::ok);
}

TEST(Renderer, ANewerModelSupersedesOneThatIsNotInUseYet) {
  Runner runner;
  runner.ticks(250);
  ASSERT_EQ(runner.accept(square_model(1, runner.now - 200, kCentre_m)), Status::ok);
  (void)runner.tick();
  ASSERT_EQ(runner.accept(square_model(2, runner.now - 10, kCentre_m)), Status::ok);
  runner.ticks(50);
  ASSERT_EQ(runner.reports.size(), 2u);
  EXPECT_EQ(runner.reports[0].sequence, 1u);
  EXPECT_EQ(runner.reports[0].status, Status::model_superseded);
  EXPECT_EQ(runner.reports[0].swap_tick, 0u);
  EXPECT_EQ(runner.reports[1].sequence, 2u);
  EXPECT_EQ(runner.reports[1].status, Status::ok);
  EXPECT_EQ(runner.renderer->model_sequence(), 2u);
}

TEST(Renderer, ResetForgetsTheModel) {
  Runner runner;
  runner.ticks(150);
  ASSERT_EQ(runner.accept(square_model(1, runner.now - 1, kCentre_m)), Status::ok);
  runner.ticks(50);
  ASSERT_EQ(runner.renderer->model_sequence(), 1u);
  runner.renderer->isr_reset();
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  EXPECT_EQ(runner.tick().flags, 0);
  ASSERT_EQ(runner.accept(square_model(2, runner.now - 1, kCentre_m)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 2u);
}

// A reset comes with a jump of the tip (calibration): what was under way before it must not be taken over
// after it.
TEST(Renderer, ResetForgetsModelsThatAreUnderWay) {
  for (int wait = 0; wait < 12; ++wait) {  // decoded, loaded, catching up, on offer, taken
    Runner runner;
    runner.ticks(150);
    ASSERT_EQ(runner.accept(square_model(1, runner.now - 20, kCentre_m)), Status::ok);
    runner.ticks(wait);
    runner.renderer->isr_reset();
    for (int i = 0; i < 60; ++i) EXPECT_EQ(runner.tick().flags, 0) << "reset after " << wait << " ticks";
    EXPECT_EQ(runner.renderer->model_sequence(), 0u);
    ASSERT_EQ(runner.reports.size(), 1u);
    ASSERT_EQ(runner.accept(square_model(2, runner.now - 1, kCentre_m)), Status::ok);
    runner.ticks(20);
    EXPECT_EQ(runner.renderer->model_sequence(), 2u);
  }
}

TEST(Renderer, TheHistoryHoldsTheLastTicks) {
  Runner runner;
  ServoSample sample;
  EXPECT_FALSE(runner.renderer->sample(0, sample));
  runner.ticks(10);
  EXPECT_TRUE(runner.renderer->sample(0, sample));
  EXPECT_FALSE(runner.renderer->sample(10, sample));
  runner.ticks(1000);
  const std::uint32_t newest = runner.now - 1;
  EXPECT_FALSE(runner.renderer->sample(newest + 1, sample));
  // One less than it has entries: the interrupt may be writing the oldest.
  EXPECT_FALSE(runner.renderer->sample(newest - (kTipHistory - 1), sample));
  for (std::uint32_t age = 0; age < kTipHistory - 1; ++age) {
    ASSERT_TRUE(runner.renderer->sample(newest - age, sample)) << age;
    EXPECT_EQ(sample.tip_m, tip_at(newest - age));
  }
}

TEST(Renderer, MissedTicksAreHeldAsTheNextOne) {
  for (const std::uint32_t missed : {1u, 7u, kTipHistory - 1, kTipHistory, 5000u}) {
    Runner runner;
    runner.ticks(300);
    const std::uint32_t last = runner.now - 1;
    runner.now += missed;
    (void)runner.tick();
    const std::uint32_t newest = runner.now - 1;
    ServoSample sample;
    for (std::uint32_t age = 0; age < kTipHistory - 1; ++age) {
      const std::uint32_t tick = newest - age;
      ASSERT_TRUE(runner.renderer->sample(tick, sample)) << missed << " missed, age " << age;
      EXPECT_EQ(sample.tip_m, tick > last ? tip_at(newest) : tip_at(tick));
    }
    // A model from within the gap can be rolled forward.
    ASSERT_EQ(runner.accept(square_model(4, newest - 1, kCentre_m)), Status::ok);
    runner.ticks(20);
    EXPECT_EQ(runner.renderer->model_sequence(), 4u);
  }
}

// Interrupt and background on two cores: the samples that the background reads are whole, and the models that
// the interrupt renders too. ThreadSanitizer watches (preset host-tsan). The whole firmware does the same in
// app_test.cpp, paced by the link; here models come as fast as they can be
// replayed.
TEST(RendererThreads, ModelsAreTakenOverWhole) {
  const auto renderer = std::make_unique<Renderer>(wire::kSchemaHash);
  constexpr std::uint32_t kTicks = 4000;
  std::atomic<std::uint32_t> ticks{0}, rounds{0};
  std::uint32_t swaps = 0, used = 0;
  std::thread interrupt([&] {
    for (std::uint32_t tick = 0; tick < kTicks; ++tick) {
      const ServoSample sample = renderer->isr_tick(tick, tip_at(tick));
      swaps += (sample.flags & kModelSwap) != 0;
      used += (sample.flags & kModelUsed) != 0;
      EXPECT_TRUE(is_finite(sample.force_N));
      ticks.store(tick + 1, std::memory_order_release);
      // The background runs about once a tick, as on a board, at any time within it.
      const std::uint32_t seen = rounds.load();
      while (rounds.load() == seen && tick + 1 < kTicks) std::this_thread::yield();
    }
  });
  const auto send = [&](std::uint32_t sequence, std::uint32_t tick) {
    ModelReport report;
    EXPECT_EQ(renderer->accept(HostPeer::payload(square_model(sequence, tick, kCentre_m)), report),
              Status::ok);
  };
  std::uint32_t sequence = 0, taken = 0, outstanding = 0;
  while (ticks.load(std::memory_order_acquire) < kTicks) {
    rounds.fetch_add(1);
    const std::uint32_t now = ticks.load(std::memory_order_acquire);
    if (now < 10) {
      std::this_thread::yield();
      continue;
    }
    if (outstanding == 0) {
      send(++sequence, now - 5);
      outstanding = sequence;
    }
    ModelReport report;
    if (renderer->catch_up(report)) {
      EXPECT_EQ(report.sequence, outstanding);
      EXPECT_TRUE(report.status == Status::ok || report.status == Status::model_too_old);
      taken += report.status == Status::ok;
      outstanding = 0;
    }
    ServoSample sample;
    if (renderer->sample(now - 5, sample)) {
      EXPECT_EQ(sample.tip_m, tip_at(now - 5));
    }
  }
  interrupt.join();
  EXPECT_GT(taken, 5u);
  EXPECT_LE(swaps - taken, 1u);  // the last one may not have been reported
  EXPECT_GT(used, kTicks / 10);
}

}  // namespace
}  // namespace palpate::firmware
