// What the renderer does with local models that are not as they must be.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "firmware/core/renderer_test_support.hpp"

namespace palpate::firmware {
namespace {

using test::expect_equal;
using test::HostPeer;
using test::kCentre_m;
using test::Runner;
using test::square_model;

struct BadMessage {
  std::string name;
  Status status;
  std::function<void(wire::ModelContents&)> spoil;
};

void PrintTo(const BadMessage& bad, std::ostream* out) {
  *out << bad.name;
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();

// A contact with one number spoilt.
template <class Spoil>
auto in_contact(Spoil spoil) {
  return [spoil](wire::ModelContents& m) {
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
        BadMessage{"missing_mode", Status::model_inconsistent,
                   [](auto& m) {
                     m.load.elements[0] = 1.0f;
                     --m.load.count;
                   }},
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
                   [](auto& m) { m.kind = palpate_ModelState_1_0_KIND_HELD_FORCE; }},
        BadMessage{"no_horizon", Status::model_inconsistent, [](auto& m) { m.valid_ticks = 0; }},
        BadMessage{"nothing_with_modes", Status::model_inconsistent,
                   [](auto& m) {
                     m.kind = palpate_ModelState_1_0_KIND_HELD_FORCE;
                     m.valid_ticks = 0;
                   }},
        BadMessage{"too_old", Status::model_too_old, [](auto& m) { m.tick -= kTipHistory; }},
        BadMessage{"from_the_future", Status::model_from_future, [](auto& m) { m.tick += 500; }}),
    [](const auto& tested) { return tested.param.name; });

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

TEST(Renderer, AnArrayBeyondItsBoundIsTooLarge) {
  Runner runner;
  runner.ticks(100);
  const auto message = square_model(5, 50, kCentre_m);
  std::vector<std::uint8_t> payload = HostPeer::payload(wire::pack(message).state);
  // The length of the array of displacements comes right after contact and steps.
  constexpr std::size_t kDisplacementCount = 102;
  ASSERT_EQ(payload.size(), kDisplacementCount + 4);
  payload[kDisplacementCount] = 97;
  EXPECT_EQ(runner.accept(payload), Status::model_too_large);
  ASSERT_EQ(runner.reports.size(), 1u);
  EXPECT_EQ(runner.reports[0].sequence, 5u);
  EXPECT_EQ(runner.reports[0].model_tick, 50u);
}

TEST(Renderer, ATruncatedPayloadIsRefused) {
  Runner runner;
  runner.ticks(100);
  const std::vector<std::uint8_t> payload =
      HostPeer::payload(wire::pack(square_model(5, 50, kCentre_m)).state);
  for (std::size_t length = 0; length < payload.size(); ++length) {
    EXPECT_NE(
        runner.accept(std::vector(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(length))),
        Status::ok)
        << length;
  }
  EXPECT_EQ(runner.accept(payload), Status::ok);
}

}  // namespace
}  // namespace palpate::firmware
