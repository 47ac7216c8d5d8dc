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

#include "firmware/core/renderer_test_support.hpp"

namespace palpate::firmware {
namespace {

using test::expect_equal;
using test::HostPeer;
using test::kCentre_m;
using test::kModelSwap;
using test::kModelUsed;
using test::Reference;
using test::Runner;
using test::square_model;
using test::tip_at;

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
      EXPECT_EQ(runner.renderer->contact_barycentric(), expected.barycentric);
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

// Where sticking would hold it, a contact that slips at the model's tick slips: late, as in time.
TEST(Renderer, AModelGoesOnSlippingOrStickingAsItsContactDid) {
  std::vector<Vec3f> first_N;
  for (const ContactMode mode : {ContactMode::stick, ContactMode::slip}) {
    Runner runner;
    runner.ticks(180);
    auto message = square_model(3, runner.now - 1, tip_at(runner.now - 1) + Vec3f{0.0f, 0.0f, 0.0005f});
    message.static_friction.elements[0] = 50.0f;
    message.kinetic_friction.elements[0] = 0.0f;
    message.contact.mode = static_cast<std::uint8_t>(mode);
    message.contact.triangle = 9;
    for (float& weight : message.contact.barycentric) weight = 1.0f / 3.0f;
    Reference reference(message, tip_at(runner.now - 1));
    for (int i = 0; i < 30; ++i) {
      (void)reference.step(tip_at(runner.now));
      (void)runner.tick();
    }
    ASSERT_EQ(runner.accept(message), Status::ok);
    std::uint32_t rendered = 0;
    for (int i = 0; i < 50; ++i) {
      const ContactState<float>& expected = reference.step(tip_at(runner.now));
      const ServoSample sample = runner.tick();
      if ((sample.flags & kModelUsed) == 0) continue;
      if (++rendered == 1) first_N.push_back(sample.force_N);
      ASSERT_EQ(sample.force_N, expected.force_N);
      ASSERT_EQ(sample.mode, expected.mode);
    }
    EXPECT_GT(rendered, 20u);
  }
  EXPECT_GT(norm(first_N[0] - first_N[1]), 1e-2f);
}

// A model that came late, or twice, after a newer one would lead back. Only a reset forgets the newer one.
TEST(Renderer, AnOlderModelDoesNotReplaceANewerOne) {
  Runner runner;
  runner.ticks(250);
  const std::uint32_t tick = runner.now - 1;
  const auto is_refused = [&](const wire::ModelContents& message) {
    const std::size_t reports = runner.reports.size();
    EXPECT_EQ(runner.accept(message), Status::model_superseded);
    ASSERT_EQ(runner.reports.size(), reports + 1);
    EXPECT_EQ(runner.reports.back().sequence, message.sequence);
    EXPECT_EQ(runner.reports.back().status, Status::model_superseded);
  };
  const auto newer = square_model(5, tick, kCentre_m), older = square_model(4, tick - 33, kCentre_m);
  ASSERT_EQ(runner.accept(newer), Status::ok);
  is_refused(older);  // while the newer one is decoded,
  is_refused(newer);
  runner.ticks(3);
  is_refused(older);  // catches up,
  is_refused(newer);
  runner.ticks(20);
  ASSERT_EQ(runner.renderer->model_sequence(), 5u);
  is_refused(older);  // is in use,
  is_refused(newer);
  ASSERT_EQ(runner.accept(square_model(6, tick + 10, kCentre_m)), Status::ok);
  auto waits = square_model(7, tick + 20, kCentre_m);
  ASSERT_EQ(runner.accept(waits), Status::ok);
  is_refused(square_model(8, tick + 15, kCentre_m));  // or waits
  runner.ticks(30);
  EXPECT_EQ(runner.renderer->model_sequence(), 7u);
  EXPECT_EQ(runner.reports.back().status, Status::ok);

  // Of the same tick, but another: as after a frame without news.
  ASSERT_EQ(runner.accept(square_model(9, tick + 20, kCentre_m)), Status::ok);
  runner.ticks(30);
  EXPECT_EQ(runner.renderer->model_sequence(), 9u);

  // One from the future is refused in its turn and holds up no other.
  ASSERT_EQ(runner.accept(square_model(10, tick + 5000, kCentre_m)), Status::ok);
  ASSERT_EQ(runner.accept(square_model(11, runner.now - 1, kCentre_m)), Status::ok);
  runner.ticks(30);
  EXPECT_EQ(runner.renderer->model_sequence(), 11u);

  runner.renderer->isr_reset();
  ASSERT_EQ(runner.accept(older), Status::ok);
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

wire::ModelContents held_force(std::uint32_t sequence, std::uint32_t tick, float force_N) {
  wire::ModelContents message{};
  message.sequence = sequence;
  message.schema_hash = wire::kSchemaHash;
  message.tick = tick;
  message.valid_ticks = 1000;
  message.kind = palpate_ModelState_1_0_KIND_HELD_FORCE;
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
    ASSERT_EQ(runner.renderer->contact_barycentric(), (Vec3f{0.0f, 1.0f, 0.0f}));
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
  EXPECT_EQ(runner.accept(held_force(1, 50, std::numeric_limits<float>::quiet_NaN())),
            Status::model_not_finite);
  ASSERT_EQ(runner.accept(held_force(2, 400, 1.0f)), Status::ok);
  runner.ticks(5);
  EXPECT_EQ(runner.reports.back().status, Status::model_from_future);
}

wire::ModelContents nothing(std::uint32_t sequence, std::uint32_t tick) {
  wire::ModelContents message = held_force(sequence, tick, 0.0f);
  message.valid_ticks = 0;
  message.contact = {};
  return message;
}

TEST(Renderer, NothingTakesAModelsPlaceWithoutAForce) {
  Runner runner;
  runner.ticks(100);
  ASSERT_EQ(runner.accept(held_force(1, 99, -1.5f)), Status::ok);
  while (runner.renderer->model_sequence() != 1) (void)runner.tick();
  ASSERT_EQ(runner.accept(nothing(2, runner.now - 1)), Status::ok);
  while (runner.renderer->model_sequence() != 2) (void)runner.tick();
  const ServoSample sample = runner.tick();
  EXPECT_EQ(sample.force_N, Vec3f{});
  EXPECT_EQ(sample.mode, ContactMode::free);
  EXPECT_EQ(runner.renderer->model_valid_ticks(), 0u);
  EXPECT_EQ(runner.reports.back().status, Status::ok);
  EXPECT_EQ(runner.reports.back().correction_energy_J, 0.0f);
}

// A force that is held may be late: it grows old. That nothing is near does not, and is no news of long ago.
TEST(Renderer, NothingIsRefusedWhenItIsOld) {
  Runner runner;
  runner.ticks(2 * kTipHistory);
  ASSERT_EQ(runner.accept(nothing(1, runner.now - 1 - kTipHistory)), Status::ok);
  runner.ticks(5);
  EXPECT_EQ(runner.reports.back().status, Status::model_too_old);
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  ASSERT_EQ(runner.accept(held_force(2, runner.now - 1 - kTipHistory, 0.0f)), Status::ok);
  runner.ticks(5);
  EXPECT_EQ(runner.renderer->model_sequence(), 2u);
  ASSERT_EQ(runner.accept(nothing(3, runner.now - 10)), Status::ok);
  runner.ticks(5);
  EXPECT_EQ(runner.renderer->model_sequence(), 3u);
}

// What has no horizon has no force either, whatever its sender makes of it.
TEST(Renderer, NothingHasNoForceAndNoContact) {
  Runner runner;
  runner.ticks(100);
  const auto refused = [&](auto&& change) {
    wire::ModelContents message = nothing(1, 99);
    change(message.contact);
    return runner.accept(message);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const float force_N : {1e-30f, -8.0f, std::numeric_limits<float>::quiet_NaN()}) {
      EXPECT_EQ(refused([&](auto& contact) { contact.force_N[axis] = force_N; }), Status::model_inconsistent);
    }
  }
  EXPECT_EQ(refused([](auto& contact) { contact.mode = palpate_Contact_1_0_MODE_STICK; }),
            Status::model_inconsistent);
  EXPECT_EQ(refused([](auto&) {}), Status::ok);
}

// A model that is not rolled forward takes the state of its own tick for the present one.
TEST(Renderer, AModelFromNowBeginsWhenItIsTakenOver) {
  Runner runner;
  runner.ticks(395);
  auto message = square_model(9, 300, kCentre_m);
  message.kind = palpate_ModelState_1_0_KIND_MODES_FROM_NOW;
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

// Were each model superseded by the next, none would ever be in use where catching up takes longer than a
// frame.
TEST(Renderer, ANewerModelWaitsForOneThatCatchesUpAndSupersedesOneThatWaits) {
  Runner runner;
  runner.ticks(250);
  ASSERT_EQ(runner.accept(square_model(1, runner.now - 60, kCentre_m)), Status::ok);
  (void)runner.tick();
  ASSERT_EQ(runner.accept(square_model(2, runner.now - 10, kCentre_m)), Status::ok);
  (void)runner.tick();
  ASSERT_EQ(runner.accept(square_model(3, runner.now - 10, kCentre_m)), Status::ok);
  runner.ticks(100);
  ASSERT_EQ(runner.reports.size(), 3u);
  EXPECT_EQ(runner.reports[0].sequence, 2u);
  EXPECT_EQ(runner.reports[0].status, Status::model_superseded);
  EXPECT_EQ(runner.reports[0].swap_tick, 0u);
  EXPECT_EQ(runner.reports[1].sequence, 1u);
  EXPECT_EQ(runner.reports[1].status, Status::ok);
  EXPECT_EQ(runner.reports[2].sequence, 3u);
  EXPECT_EQ(runner.reports[2].status, Status::ok);
  EXPECT_EQ(runner.renderer->model_sequence(), 3u);
}

// A frame behind, with the work of a smaller and a larger part.
TEST(Renderer, MoreWorkCatchesUpInFewerTicks) {
  const auto swapped_after = [](const CatchUpPolicy& policy) {
    Runner runner;
    runner.renderer = std::make_unique<Renderer>(wire::kSchemaHash, policy);
    runner.ticks(250);
    EXPECT_EQ(runner.accept(square_model(1, runner.now - 33, kCentre_m)), Status::ok);
    const std::uint32_t accepted = runner.now;
    runner.ticks(100);
    EXPECT_EQ(runner.renderer->model_sequence(), 1u);
    return runner.reports.at(0).swap_tick - accepted;
  };
  EXPECT_LT(swapped_after(kCatchUpCortexM7), swapped_after(kCatchUpCortexM4));
}

TEST(Renderer, AModelThatDoesNotCatchUpInTimeGivesWay) {
  for (const std::uint32_t late : {kCatchUpHorizon_ticks - 40, kCatchUpHorizon_ticks + 1}) {
    Runner runner;
    runner.ticks(250);
    ASSERT_EQ(runner.accept(square_model(1, runner.now - 10, kCentre_m)), Status::ok);
    // The background has no time.
    for (std::uint32_t i = 0; i < late; ++i, ++runner.now)
      (void)runner.renderer->isr_tick(runner.now, tip_at(runner.now));
    ASSERT_EQ(runner.accept(square_model(2, runner.now - 10, kCentre_m)), Status::ok);
    runner.ticks(60);
    ASSERT_EQ(runner.reports.size(), 2u);
    EXPECT_EQ(runner.reports[0].sequence, 1u);
    EXPECT_EQ(runner.reports[0].status, late > kCatchUpHorizon_ticks ? Status::model_superseded : Status::ok);
    EXPECT_EQ(runner.reports[1].sequence, 2u);
    EXPECT_EQ(runner.reports[1].status, Status::ok);
  }
}

std::vector<palpate_ModelPart_1_0> parts_of(const wire::PackedModel& packed) {
  return wire::parts_of(*packed.basis, packed.state.basis_id);
}

// A model with another basis, at the same place, that is at rest likewise.
wire::ModelContents other_model(std::uint32_t sequence, std::uint32_t tick, float tip_radius_m) {
  wire::ModelContents message = square_model(sequence, tick, kCentre_m);
  message.tip_radius_m = tip_radius_m;
  return message;
}

// In contact, 30 ticks late: from the swap on to the bit what a model of that state would have done.
TEST(Renderer, AStateAloneCorrectsTheModel) {
  Runner runner;
  runner.ticks(200);
  const auto first = square_model(1, runner.now - 1, kCentre_m);
  ASSERT_EQ(runner.accept(first), Status::ok);
  Reference before(first, tip_at(runner.now - 1));
  for (int i = 0; i < 360; ++i) {
    (void)before.step(tip_at(runner.now));
    (void)runner.tick();
  }
  ASSERT_NE(before.contact().mode, ContactMode::free);
  auto corrected = before.as_it_is(2, runner.now - 1);
  corrected.state_p.elements[3] += 1e-3f;
  const wire::PackedModel packed = wire::pack(corrected);
  ASSERT_EQ(packed.state.basis_id, wire::pack(first).state.basis_id);
  Reference after(corrected, tip_at(runner.now - 1));
  for (int i = 0; i < 30; ++i) {
    (void)after.step(tip_at(runner.now));
    (void)runner.tick();
  }
  ASSERT_EQ(runner.accept(HostPeer::payload(packed.state)), Status::ok);
  bool swapped = false;
  std::uint32_t contact_ticks = 0;
  for (int i = 0; i < 100; ++i) {
    const Vec3f expected_N = after.step(tip_at(runner.now)).force_N;
    const ServoSample sample = runner.tick();
    swapped = swapped || (sample.flags & kModelSwap) != 0;
    if (!swapped) continue;
    EXPECT_EQ(sample.force_N, expected_N);
    contact_ticks += sample.mode != ContactMode::free;
  }
  EXPECT_TRUE(swapped);
  EXPECT_GT(contact_ticks, 20u);
  EXPECT_EQ(runner.renderer->model_sequence(), 2u);
  ASSERT_EQ(runner.basis_events.size(), 1u);  // the first model's
}

TEST(Renderer, AStateWaitsForItsBasis) {
  Runner runner;
  runner.ticks(150);
  const wire::PackedModel packed = wire::pack(square_model(1, runner.now - 1, kCentre_m));
  const auto parts = parts_of(packed);
  ASSERT_GE(parts.size(), 1u);
  ASSERT_EQ(runner.accept(HostPeer::payload(packed.state)), Status::ok);
  runner.ticks(20);
  EXPECT_TRUE(runner.reports.empty());
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  ASSERT_EQ(runner.basis_events.size(), 1u);
  EXPECT_EQ(runner.basis_events[0].id, packed.state.basis_id);
  EXPECT_EQ(runner.basis_events[0].status, Status::basis_missing);
  for (const auto& part : parts) EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 1u);
  ASSERT_EQ(runner.reports.size(), 1u);
  EXPECT_EQ(runner.reports[0].status, Status::ok);
}

// Three bases are on the board: of the active model, of the one that catches up, and of the state that waits
// until it has. A fourth finds no room.
TEST(Renderer, AStateThatWaitsKeepsItsBasis) {
  Runner runner;
  runner.ticks(150);
  ASSERT_EQ(runner.accept(square_model(1, runner.now - 1, kCentre_m)), Status::ok);
  runner.ticks(200);
  ASSERT_EQ(runner.renderer->model_sequence(), 1u);
  ASSERT_EQ(runner.accept(other_model(2, runner.now - 60, 0.001f)), Status::ok);
  ASSERT_EQ(runner.accept(other_model(3, runner.now - 1, 0.002f)), Status::ok);
  runner.ticks(3);
  ASSERT_EQ(runner.renderer->model_sequence(), 1u);
  runner.basis_events.clear();
  const wire::PackedModel fourth = wire::pack(other_model(4, runner.now - 1, 0.003f));
  for (const auto& part : parts_of(fourth))
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(1);
  ASSERT_EQ(runner.basis_events.size(), 1u);
  EXPECT_EQ(runner.basis_events[0].id, fourth.state.basis_id);
  EXPECT_EQ(runner.basis_events[0].status, Status::basis_dropped);
  runner.ticks(60);
  EXPECT_EQ(runner.renderer->model_sequence(), 3u);
  // Then there is room.
  for (const auto& part : parts_of(fourth))
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  ASSERT_EQ(runner.accept(HostPeer::payload(fourth.state)), Status::ok);
  runner.ticks(60);
  EXPECT_EQ(runner.renderer->model_sequence(), 4u);
}

TEST(Renderer, OnlyTheNewestStateWaits) {
  Runner runner;
  runner.ticks(150);
  ASSERT_EQ(runner.accept(square_model(1, runner.now - 1, kCentre_m)), Status::ok);
  runner.ticks(20);
  ASSERT_EQ(runner.reports.size(), 1u);
  const wire::PackedModel second = wire::pack(other_model(2, runner.now - 1, 0.001f));
  const wire::PackedModel third = wire::pack(other_model(3, runner.now - 1, 0.002f));
  for (const auto* packed : {&second, &third})
    ASSERT_EQ(runner.accept(HostPeer::payload(packed->state)), Status::ok);
  runner.ticks(2);
  ASSERT_EQ(runner.reports.size(), 2u);
  EXPECT_EQ(runner.reports[1].sequence, 2u);
  EXPECT_EQ(runner.reports[1].status, Status::model_superseded);
  EXPECT_EQ(runner.renderer->model_sequence(), 1u);
  for (const auto* packed : {&second, &third})
    for (const auto& part : parts_of(*packed))
      EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 3u);
  // A newer one that need not wait supersedes one that waits.
  ASSERT_EQ(runner.accept(HostPeer::payload(wire::pack(other_model(4, runner.now - 1, 0.003f)).state)),
            Status::ok);
  wire::PackedModel fifth = third;
  fifth.state.sequence = 5;
  fifth.state.tick = runner.now - 1;
  ASSERT_EQ(runner.accept(HostPeer::payload(fifth.state)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 5u);
  ASSERT_EQ(runner.reports.size(), 5u);
  EXPECT_EQ(runner.reports[3].sequence, 4u);
  EXPECT_EQ(runner.reports[3].status, Status::model_superseded);
  EXPECT_EQ(runner.reports[4].sequence, 5u);
  EXPECT_EQ(runner.reports[4].status, Status::ok);
}

TEST(Renderer, AStateThatWaitedTooLongIsDropped) {
  Runner runner;
  runner.ticks(300);
  const wire::PackedModel packed = wire::pack(square_model(1, runner.now - 1, kCentre_m));
  ASSERT_EQ(runner.accept(HostPeer::payload(packed.state)), Status::ok);
  runner.ticks(static_cast<int>(kTipHistory));
  for (const auto& part : parts_of(packed))
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(5);
  ASSERT_EQ(runner.reports.size(), 1u);
  EXPECT_EQ(runner.reports[0].status, Status::model_too_old);
}

// Every piece is damaged once: the bytes do not have the identifier that they say, and the state waits on.
TEST(Renderer, ABasisOfOtherBytesIsNotUsed) {
  Runner runner;
  runner.ticks(150);
  const wire::PackedModel packed = wire::pack(square_model(1, runner.now - 1, kCentre_m));
  ASSERT_EQ(runner.accept(HostPeer::payload(packed.state)), Status::ok);
  for (auto part : parts_of(packed)) {
    part.data.elements[100] ^= 0x10u;
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  }
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  ASSERT_EQ(runner.basis_events.size(), 2u);
  EXPECT_EQ(runner.basis_events[1].status, Status::basis_crc_mismatch);
  for (const auto& part : parts_of(packed))
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 1u);
}

// Bases come and go while models are rendered: the active one and the shadow keep theirs.
TEST(Renderer, BasesInUseAreNotOverwritten) {
  Runner busy, quiet;
  for (int i = 0; i < 900; ++i) {
    for (Runner* runner : {&busy, &quiet}) {
      if (i == 230 || i == 300 || i == 520) {
        ASSERT_EQ(runner->accept(other_model(static_cast<std::uint32_t>(i), runner->now - 15,
                                             1e-6f * static_cast<float>(i))),
                  Status::ok);
      }
    }
    const wire::PackedModel noise = wire::pack(other_model(0, 0, 0.01f + 1e-5f * static_cast<float>(i)));
    for (const auto& part : parts_of(noise))
      EXPECT_EQ(busy.renderer->accept_part(HostPeer::payload(part)), Status::ok);
    const std::uint32_t tick = busy.now;
    expect_equal(busy.tick(), quiet.tick(), tick);
  }
  EXPECT_EQ(busy.renderer->model_sequence(), 520u);
}

TEST(Renderer, ResetForgetsAStateThatWaits) {
  Runner runner;
  runner.ticks(150);
  const wire::PackedModel packed = wire::pack(square_model(1, runner.now - 1, kCentre_m));
  ASSERT_EQ(runner.accept(HostPeer::payload(packed.state)), Status::ok);
  runner.renderer->isr_reset();
  for (const auto& part : parts_of(packed))
    EXPECT_EQ(runner.renderer->accept_part(HostPeer::payload(part)), Status::ok);
  runner.ticks(20);
  EXPECT_EQ(runner.renderer->model_sequence(), 0u);
  ASSERT_EQ(runner.reports.size(), 1u);
  EXPECT_EQ(runner.reports[0].status, Status::model_superseded);
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
  const auto renderer = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
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
    EXPECT_EQ(test::deliver(*renderer, square_model(sequence, tick, kCentre_m), report), Status::ok);
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
