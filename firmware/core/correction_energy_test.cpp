// Energy of corrections (renderer.hpp) against a closed form: the models are springs without mass.
//
// A model gives way at once, by force / k and as a whole. With the target of the contact half a tick ahead
// (ModalSurface) its force is F[t] = k (d[t] + (d[t] - d[t-1]) / 2), d the depth of the tip. Where that grows
// by the same in each tick, F[t] (d[t+1] - d[t]) is the integral of k d over the tick, so that a model with
// k' that replaces one with k corrects
//   (k' - k) (d[s]^2 - d[c]^2) / 2,
// c: the first tick that it accounts for, s: the tick of its take-over.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/core/renderer_test_support.hpp"

namespace palpate::firmware {
namespace {

using test::HostPeer;
using test::kCentre_m;
using test::square_model;

// The middle of the first triangle.
constexpr float kWidth_m = 0.01f;
constexpr Vec3f kPlace_m = kCentre_m + Vec3f{kWidth_m / 6.0f, -kWidth_m / 6.0f, 0.0f};
// A force has some ten roundings of 6e-8, and so has a sum of 100 terms of one sign.
constexpr double kRounding = 1e-5;

wire::ModelContents spring(std::uint32_t sequence, std::uint32_t tick, double stiffness_N_m) {
  wire::ModelContents m = square_model(sequence, tick, kCentre_m);
  constexpr std::uint16_t kModes = 3, kNodes = 4;
  m.modes = kModes;
  for (auto* field : {&m.load, &m.state_q, &m.state_p}) {
    field->count = kModes;
    std::fill_n(field->elements, kModes, 0.0f);
  }
  m.basis_scale.count = kModes;
  std::fill_n(m.basis_scale.elements, kModes, 1.0f / 32767.0f);
  m.basis.count = std::size_t{3} * kNodes * kModes;
  m.coefficient.count = std::size_t{kCoefficientsPerMode} * kModes;
  for (std::size_t mode = 0; mode < kModes; ++mode) {
    for (std::size_t row = 0; row < 3 * kNodes; ++row)
      m.basis.elements[row * kModes + mode] = row % 3 == mode ? 32767 : 0;
    // q and p are forgotten in each tick; q is then input / k.
    const float c[]{-1.0f, 0.0f, 0.0f, -1.0f, static_cast<float>(1.0 / stiffness_N_m), 0.0f};
    std::copy_n(c, kCoefficientsPerMode, m.coefficient.elements + kCoefficientsPerMode * mode);
  }
  return m;
}

wire::ModelContents touching(wire::ModelContents m) {
  m.contact.mode = palpate_Contact_1_0_MODE_STICK;
  m.contact.triangle = 7;
  for (float& weight : m.contact.barycentric) weight = 1.0f / 3.0f;
  return m;
}

class CorrectionEnergy : public ::testing::Test {
 protected:
  // Deeper by `step_m` in each tick.
  void move(double step_m, int ticks) {
    for (int i = 0; i < ticks; ++i) tick(depth_m_.back() + step_m);
  }
  void tick(double depth_m) {
    const Vec3f tip_m = kPlace_m - Vec3f{0.0f, 0.0f, static_cast<float>(depth_m)};
    (void)renderer_->isr_tick(now(), tip_m);
    depth_m_.push_back(static_cast<double>(kPlace_m.z) - static_cast<double>(tip_m.z));
    ModelReport report;
    if (renderer_->catch_up(report)) reports_.push_back(report);
    while (renderer_->next_report(report)) reports_.push_back(report);
  }
  void accept(const wire::ModelContents& contents) {
    ModelReport report;
    if (test::deliver(*renderer_, contents, report) != Status::ok) reports_.push_back(report);
  }
  // Moves on until `count` models were reported; the last one must have been taken over.
  const ModelReport& move_until(double step_m, std::size_t count) {
    for (int i = 0; i < 100 && reports_.size() < count; ++i) move(step_m, 1);
    EXPECT_EQ(reports_.size(), count);
    EXPECT_EQ(reports_.back().status, Status::ok);
    EXPECT_GE(reports_.back().swap_tick, reports_.back().model_tick + 20u);
    return reports_.back();
  }
  // Of a spring that takes over in tick `until`, accounted from tick `from` on.
  [[nodiscard]] double integral_J(double change_N_m, std::uint32_t from, std::uint32_t until) const {
    const double a_m = depth_m_[from], b_m = depth_m_[until];
    return 0.5 * change_N_m * (b_m * b_m - a_m * a_m);
  }
  void expect_energy(double actual_J, double expected_J) const {
    EXPECT_GT(std::fabs(expected_J), 1e-6);
    EXPECT_NEAR(actual_J, expected_J, kRounding * std::fabs(expected_J));
  }
  [[nodiscard]] std::uint32_t now() const { return static_cast<std::uint32_t>(depth_m_.size()); }
  [[nodiscard]] double sum_J() const { return static_cast<double>(renderer_->correction_energy_J()); }

  static constexpr double kStep_m = 1e-5;
  std::unique_ptr<Renderer> renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
  std::vector<double> depth_m_;  // by tick
  std::vector<ModelReport> reports_;

 public:
  CorrectionEnergy() {
    tick(-1e-3);
    move(0.0, 9);
  }
};

double energy_J(const ModelReport& report) {
  return static_cast<double>(report.correction_energy_J);
}

TEST_F(CorrectionEnergy, IsTheIntegralOfTheDifferenceOfTwoSprings) {
  struct Case {
    double late_N_m, corrected_N_m, step_m;
    bool injected;
  };
  // What is too soft while the tip presses takes too little from the hand; what is too stiff gives too much
  // back.
  for (const Case& c : {Case{200.0, 300.0, kStep_m, true}, Case{300.0, 200.0, kStep_m, false},
                        Case{200.0, 300.0, -kStep_m, false}, Case{300.0, 200.0, -kStep_m, true}}) {
    renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
    depth_m_.clear();
    reports_.clear();
    tick(-1e-3);
    accept(spring(1, 0, c.late_N_m));
    move(0.0, 20);
    ASSERT_EQ(reports_.size(), 1u);
    EXPECT_EQ(reports_[0].correction_energy_J, 0.0f);  // in the air
    move(kStep_m, 250);
    move(c.step_m, 60);
    accept(touching(spring(2, now() - 50, c.corrected_N_m)));
    const ModelReport& report = move_until(c.step_m, 2);
    expect_energy(energy_J(report),
                  integral_J(c.corrected_N_m - c.late_N_m, report.model_tick + 1, report.swap_tick));
    EXPECT_EQ(energy_J(report) > 0.0, c.injected);
    EXPECT_EQ(renderer_->correction_energy_J(), report.correction_energy_J);
  }
}

// Nothing was rendered while the tip pressed: the hand was spared all of the work. The contact begins in the
// replay.
TEST_F(CorrectionEnergy, OfTheFirstModelIsAllThatItWouldHaveTaken) {
  move(kStep_m, 80);
  const std::uint32_t model_tick = now() - 1;
  move(kStep_m, 60);
  accept(spring(1, model_tick, 250.0));
  const ModelReport& report = move_until(kStep_m, 1);
  std::uint32_t touched = model_tick;
  while (depth_m_[touched] <= 0.0) ++touched;
  ASSERT_GT(touched, model_tick + 5);
  expect_energy(energy_J(report), integral_J(250.0, touched, report.swap_tick));
}

// The third model's own tick lies before the second's take-over: what was rendered until then is in the
// second's account.
TEST_F(CorrectionEnergy, CountsEachTickOnce) {
  accept(spring(1, now() - 1, 200.0));
  move(kStep_m, 220);
  ASSERT_EQ(reports_.size(), 1u);
  const auto second = touching(spring(2, now() - 30, 300.0)), third = touching(spring(3, now() - 10, 350.0));
  accept(second);
  const ModelReport after_second = move_until(kStep_m, 2);
  ASSERT_GT(after_second.swap_tick, third.tick + 5);
  expect_energy(energy_J(after_second), integral_J(100.0, second.tick + 1, after_second.swap_tick));
  move(kStep_m, 20);
  accept(third);
  const ModelReport after_third = move_until(kStep_m, 3);
  expect_energy(energy_J(after_third), integral_J(50.0, after_second.swap_tick, after_third.swap_tick));
  EXPECT_EQ(renderer_->correction_energy_J(),
            after_second.correction_energy_J + after_third.correction_energy_J);
  move(kStep_m, 40);
  const auto fourth = touching(spring(4, now() - 20, 300.0));
  accept(fourth);
  const ModelReport& after_fourth = move_until(kStep_m, 4);
  expect_energy(energy_J(after_fourth), integral_J(-50.0, fourth.tick + 1, after_fourth.swap_tick));
}

// Whatever came before a reset belongs to another calibration.
TEST_F(CorrectionEnergy, StartsAgainWithAReset) {
  accept(spring(1, now() - 1, 200.0));
  move(kStep_m, 200);
  accept(touching(spring(2, now() - 40, 300.0)));
  (void)move_until(kStep_m, 2);
  EXPECT_NE(sum_J(), 0.0);
  move(kStep_m, 8);
  const std::uint32_t reset_tick = now() - 1;
  renderer_->isr_reset();
  EXPECT_EQ(sum_J(), 0.0);
  move(kStep_m, 20);
  accept(touching(spring(3, reset_tick - 5, 350.0)));
  const ModelReport& report = move_until(kStep_m, 3);
  expect_energy(energy_J(report), integral_J(350.0, reset_tick + 1, report.swap_tick));
  EXPECT_EQ(renderer_->correction_energy_J(), report.correction_energy_J);
}

TEST_F(CorrectionEnergy, IsZeroWhereNothingIsReplayed) {
  accept(spring(1, now() - 1, 200.0));
  move(kStep_m, 200);
  auto from_now = touching(spring(2, now() - 40, 300.0));
  from_now.kind = palpate_ModelState_1_0_KIND_MODES_FROM_NOW;
  accept(from_now);
  (void)move_until(kStep_m, 2);
  wire::ModelContents held = from_now;
  held.sequence = 3;
  held.kind = palpate_ModelState_1_0_KIND_HELD_FORCE;
  held.contact.force_N[2] = -3.0f;
  held.modes = 0;
  held.nodes = held.surface_nodes = held.triangles = 0;
  const wire::PackedModel packed = wire::pack(held);
  ModelReport refused;
  ASSERT_EQ(renderer_->accept(HostPeer::payload(packed.state), refused), Status::ok);
  (void)move_until(kStep_m, 3);
  // One that waits, and one that is too old.
  accept(spring(4, now() - 40, 300.0));
  accept(spring(5, now() - 40, 300.0));
  accept(spring(6, now() - 40, 300.0));
  move(kStep_m, 1);
  for (const ModelReport& report : reports_) EXPECT_EQ(report.correction_energy_J, 0.0f) << report.sequence;
  ASSERT_EQ(reports_.size(), 4u);
  EXPECT_EQ(reports_[3].status, Status::model_superseded);
  EXPECT_EQ(sum_J(), 0.0);
}

TEST_F(CorrectionEnergy, IsANumberWhereTheForcesAreNone) {
  accept(spring(1, now() - 1, 200.0));
  move(kStep_m, 200);
  auto growing = touching(spring(2, now() - 30, 1e8));
  growing.coefficient.elements[2 * kCoefficientsPerMode] = 3e38f;  // along the normal
  growing.state_q.elements[2] = 1e-3f;
  accept(growing);
  const ModelReport& report = move_until(kStep_m, 2);
  EXPECT_EQ(report.correction_energy_J, 0.0f);
  EXPECT_EQ(renderer_->correction_energy_J(), 0.0f);
}

// In a tick that is lost the last force is held. The background replays it with the tip of the next one, and
// an offer that the interrupt has missed is caught up again.
TEST_F(CorrectionEnergy, OfLostTicksIsThatOfTheForceBefore) {
  accept(spring(1, now() - 1, 200.0));
  move(kStep_m, 200);
  accept(touching(spring(2, now() - 30, 300.0)));
  std::vector<bool> lost(now(), false);
  for (int i = 0; i < 30; ++i) {
    depth_m_.push_back(depth_m_.back() + 2 * kStep_m);
    tick(depth_m_.back());
    depth_m_[now() - 2] = depth_m_[now() - 1];  // as the history has it
    lost.insert(lost.end(), {true, false});
  }
  ASSERT_EQ(reports_.size(), 1u);  // an offer is for the next tick, which never comes
  const ModelReport& report = move_until(kStep_m, 2);
  lost.resize(depth_m_.size(), false);
  const auto force_N = [&](double stiffness_N_m, std::uint32_t t, std::uint32_t before) {
    return stiffness_N_m * (depth_m_[t] + 0.5 * (depth_m_[t] - depth_m_[before]));
  };
  double expected_J = 0;
  for (std::uint32_t t = report.model_tick + 1; t < report.swap_tick; ++t) {
    if (lost[t]) continue;  // the tip is where the next one has it
    const double rendered_N = force_N(200.0, t, lost[t - 1] ? t - 2 : t - 1);
    expected_J += (force_N(300.0, t, t - 1) - rendered_N) * (depth_m_[t + 1] - depth_m_[t]);
  }
  expect_energy(energy_J(report), expected_J);
}

}  // namespace
}  // namespace palpate::firmware
