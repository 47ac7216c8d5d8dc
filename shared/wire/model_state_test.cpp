#include "shared/wire/model_state.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "shared/model/backward_euler_mode.hpp"
#include "shared/servo_tick.hpp"
#include "shared/wire/model_view.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::wire {
namespace {

// Single precision of the sums that the bounds are compared with, relative.
constexpr double kSingle = 1e-5;

// Modes from 1 to 300 Hz with bases of very different sizes, some of them moving no node of the surface.
ModelContents contents(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  ModelContents m;
  m.modes = 48;
  m.nodes = m.surface_nodes = 32;
  m.triangles = 1;
  m.position_m.count = m.rest_m.count = 96;
  m.coefficient.count = kCoefficientsPerMode * 48;
  m.basis_scale.count = m.load.count = m.state_q.count = m.state_p.count = 48;
  m.basis.count = 96 * 48;
  m.static_friction.count = m.kinetic_friction.count = 1;
  m.triangle_id.count = m.triangle_friction.count = 1;
  m.corner.count = 3;
  for (std::size_t i = 0; i < 96; ++i) {
    m.rest_m.elements[i] = static_cast<float>(0.02 * normal(random));
    m.position_m.elements[i] = m.rest_m.elements[i] + static_cast<float>(0.003 * normal(random));
  }
  for (std::size_t mode = 0; mode < 48; ++mode) {
    const double lambda_rad2_s2 = std::pow(6.28 * std::pow(300.0, static_cast<double>(mode) / 47.0), 2);
    backward_euler_mode(static_cast<float>(lambda_rad2_s2), static_cast<float>(std::sqrt(lambda_rad2_s2)),
                        m.coefficient.elements + kCoefficientsPerMode * mode);
    const bool unseen = mode % 16 == 5;
    const double largest = unseen ? 0.0 : std::pow(10.0, 0.5 * normal(random));  // 1 / sqrt(kg)
    m.basis_scale.elements[mode] = static_cast<float>(largest / 32767.0);
    for (std::size_t row = 0; row < 96; ++row)
      m.basis.elements[row * 48 + mode] =
          unseen ? std::int16_t{0} : static_cast<std::int16_t>(random() % 65535 - 32767);
    m.state_q.elements[mode] = static_cast<float>(1e-3 * normal(random));
    m.state_p.elements[mode] = static_cast<float>(1e-2 * normal(random));
    m.load.elements[mode] = static_cast<float>(lambda_rad2_s2 * 1e-3 * normal(random));
  }
  return m;
}

// Of the node displacements that the difference of two modal vectors makes, the largest.
double largest_difference(const ModelContents& m, const std::vector<double>& modal) {
  double largest = 0.0;
  for (std::size_t row = 0; row < 96; ++row) {
    double sum = 0.0;
    for (std::size_t mode = 0; mode < 48; ++mode)
      sum +=
          m.basis.elements[row * 48 + mode] * static_cast<double>(m.basis_scale.elements[mode]) * modal[mode];
    largest = std::max(largest, std::abs(sum));
  }
  return largest;
}

std::vector<double> difference(const float* a, const float* b) {
  std::vector<double> result(48);
  for (std::size_t i = 0; i < 48; ++i) result[i] = static_cast<double>(a[i]) - static_cast<double>(b[i]);
  return result;
}

TEST(ModelState, ErrorsStayWithinHalfAStep) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const ModelContents sent = contents(seed);
    const PackedModel packed = pack(sent);
    const ModelContents got = unpack(packed, sent);
    const palpate_ModelState_1_0& state = packed.state;
    double error_m = 0.0, largest_m = 0.0;
    for (std::size_t i = 0; i < 96; ++i) {
      const auto at = [i](const ModelContents& m) { return static_cast<double>(m.position_m.elements[i]); };
      error_m = std::max(error_m, std::abs(at(got) - at(sent)));
      largest_m = std::max(largest_m, std::abs(at(sent) - static_cast<double>(sent.rest_m.elements[i])));
    }
    // The step is the largest by 32767; positions of 0.1 m are rounded to 4e-9 m twice.
    EXPECT_NEAR(static_cast<double>(state.displacement_step_m), largest_m / 32767.0, 1e-6 * largest_m);
    EXPECT_LE(error_m, 0.5 * static_cast<double>(state.displacement_step_m) + 1e-8);
    EXPECT_GE(error_m, 0.2 * static_cast<double>(state.displacement_step_m));  // it is quantized

    const auto bound = [](float step) { return 48 * 0.5 * static_cast<double>(step) * (1.0 + kSingle); };
    EXPECT_LE(largest_difference(sent, difference(got.state_q.elements, sent.state_q.elements)),
              bound(state.q_step_m) + kSingle * 1e-3);
    EXPECT_LE(largest_difference(sent, difference(got.state_p.elements, sent.state_p.elements)),
              bound(state.p_step_m_s) + kSingle * 1e-2);
    std::vector<double> deflection = difference(got.load.elements, sent.load.elements);
    for (std::size_t mode = 0; mode < 48; ++mode) {
      const float* c = sent.coefficient.elements + kCoefficientsPerMode * mode;
      if (mode % 16 == 5) deflection[mode] = 0.0;
      deflection[mode] /= -static_cast<double>(c[0]) / static_cast<double>(c[4]);
    }
    // The softest mode has 39.4 / s^2, for which 40 is taken.
    EXPECT_LE(largest_difference(sent, deflection), bound(state.load_step_m) * 40.0 / 39.4 + kSingle * 1e-2);
  }
}

TEST(ModelState, ArraysOfZerosAreNotSent) {
  ModelContents m = contents(1);
  std::fill_n(m.state_q.elements, 48, 0.0f);
  std::copy_n(m.rest_m.elements, 96, m.position_m.elements);
  const PackedModel packed = pack(m);
  EXPECT_EQ(packed.state.q.count, 0u);
  EXPECT_EQ(packed.state.displacement.count, 0u);
  const ModelContents got = unpack(packed, m);
  for (std::size_t i = 0; i < 48; ++i) EXPECT_EQ(got.state_q.elements[i], 0.0f);
  for (std::size_t i = 0; i < 96; ++i) EXPECT_EQ(got.position_m.elements[i], m.rest_m.elements[i]);
}

TEST(ModelState, WhatIsNoNumberStaysNone) {
  ModelContents m = contents(1);
  m.state_p.elements[7] = NAN;
  m.load.elements[3] = INFINITY;
  const ModelContents got = unpack(pack(m), m);
  EXPECT_FALSE(std::isfinite(got.state_p.elements[7]));
  EXPECT_FALSE(std::isfinite(got.load.elements[3]));
}

TEST(ModelState, CountsMustAgree) {
  const ModelContents m = contents(1);
  palpate_ModelState_1_0 state = pack(m).state;
  const LocalModelView view = view_of(m);
  EXPECT_TRUE(counts_agree(state, view));
  for (std::size_t* count : {&state.displacement.count, &state.load.count, &state.q.count, &state.p.count}) {
    --*count;
    EXPECT_FALSE(counts_agree(state, view));
    ++*count;
  }
}

}  // namespace
}  // namespace palpate::wire
