#include "shared/model/near_field.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

#include "shared/model/modal_surface.hpp"
#include "shared/model/test_model.hpp"
#include "shared/servo_tick.hpp"

namespace palpate {
namespace {

// Single precision: forces here are sums of numbers up to 1 N.
constexpr double kRounding_N = 1e-5;

Vec3d widen(const Vec3f& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

Vec3d at(const std::vector<float>& values, std::size_t node) {
  return {static_cast<double>(values[3 * node]), static_cast<double>(values[3 * node + 1]),
          static_cast<double>(values[3 * node + 2])};
}

class NearFieldTest : public ::testing::Test {
 protected:
  NearFieldTest() {
    for (Vec3f& v : velocity_m_s_) v = random_vector(0.05f);
    near_.bind();
    for (std::uint32_t n = 0; n < 4; ++n) near_.start_with(model_.view, n, velocity_m_s_[n]);
  }
  Vec3f random_vector(float size) {
    std::uniform_real_distribution<float> uniform(-size, size);
    return {uniform(random_), uniform(random_), uniform(random_)};
  }
  Vec3f start_m(std::size_t n) const {
    return {model_.position_m[3 * n], model_.position_m[3 * n + 1], model_.position_m[3 * n + 2]};
  }

  // Of spring s on its first node, u and w the separation and its rate.
  Vec3d exact_N(std::size_t s, const Vec3d& u, const Vec3d& w) const {
    const std::size_t kind = springs_.kind[s];
    const Vec3d e = normalized(u);
    return e * (static_cast<double>(springs_.stiffness_N_m[kind]) *
                    (norm(u) - static_cast<double>(springs_.length_m[kind])) +
                static_cast<double>(springs_.damping_N_s_m[kind]) * dot(w, e));
  }
  // The force that the model has already: linear about the start, with the tangent at rest.
  Vec3d linear_N(std::size_t s, const Vec3d& u, const Vec3d& w) const {
    const std::size_t i = springs_.end[2 * s], j = springs_.end[2 * s + 1], kind = springs_.kind[s];
    const Vec3d n = normalized(at(springs_.rest_m, j) - at(springs_.rest_m, i));
    const Vec3d u0 = widen(start_m(j)) - widen(start_m(i));
    const Vec3d w0 = widen(velocity_m_s_[j]) - widen(velocity_m_s_[i]);
    return exact_N(s, u0, w0) + n * (static_cast<double>(springs_.stiffness_N_m[kind]) * dot(n, u - u0) +
                                     static_cast<double>(springs_.damping_N_s_m[kind]) * dot(n, w - w0));
  }

  std::mt19937 random_{3};
  test::TestModel model_{1e-3, 50, 1500, 1.0};
  test::TestSprings springs_{model_};
  std::array<Vec3f, 4> velocity_m_s_{};
  NearField near_;
};

TEST_F(NearFieldTest, IsNothingAtTheModelsStart) {
  near_.follow(model_.view, 0);
  std::array<Vec3f, kMaxSurfaceNodes> position_m{};
  for (std::size_t n = 0; n < 4; ++n) position_m[n] = start_m(n);
  EXPECT_EQ(near_.springs(), 6u);
  // The nodes move as they did: neither separations nor their rates have changed.
  near_.evaluate(model_.view, position_m, 1, 0.0f);
  for (std::size_t n = 0; n < 4; ++n) EXPECT_NEAR(norm(widen(near_.force_N()[n])), 0.0, kRounding_N);
  // The ends are looked at a period ahead: with no velocity that is where they are.
  near_.bind();
  for (std::uint32_t n = 0; n < 4; ++n) near_.start_with(model_.view, n, {});
  near_.follow(model_.view, 0);
  near_.evaluate(model_.view, position_m, 2, 2.0f);
  for (std::size_t n = 0; n < 4; ++n) EXPECT_NEAR(norm(widen(near_.force_N()[n])), 0.0, kRounding_N);
}

// Compared with the force law in double precision, nodes displaced by up to 4 mm in cells of 1 cm.
TEST_F(NearFieldTest, IsTheExactForceLessTheLinearOne) {
  near_.follow(model_.view, 1);
  constexpr double kPeriod_s = 2 * kTick_s;
  std::array<Vec3f, kMaxSurfaceNodes> before_m{}, position_m{};
  for (std::size_t n = 0; n < 4; ++n) before_m[n] = start_m(n) + random_vector(4e-3f);
  for (std::size_t n = 0; n < 4; ++n) position_m[n] = before_m[n] + random_vector(2e-4f);
  near_.evaluate(model_.view, before_m, 1, 2.0f);
  near_.evaluate(model_.view, position_m, 2, 2.0f);
  std::array<Vec3d, 4> expected{};
  double largest = 0;
  for (std::size_t s = 0; s < springs_.kind.size(); ++s) {
    const std::size_t i = springs_.end[2 * s], j = springs_.end[2 * s + 1];
    const Vec3d now = widen(position_m[j]) - widen(position_m[i]);
    const Vec3d change = now - (widen(before_m[j]) - widen(before_m[i]));
    const Vec3d u = now + change, w = change * (1.0 / kPeriod_s);
    const Vec3d beyond = exact_N(s, u, w) - linear_N(s, u, w);
    expected[i] += beyond;
    expected[j] -= beyond;
    largest = std::max(largest, norm(beyond));
  }
  EXPECT_GT(largest, 0.01);
  Vec3d sum{};
  for (std::size_t n = 0; n < 4; ++n) {
    EXPECT_NEAR(norm(widen(near_.force_N()[n]) - expected[n]), 0.0, kRounding_N) << "node " << n;
    sum += widen(near_.force_N()[n]);
  }
  EXPECT_NEAR(norm(sum), 0.0, kRounding_N);
}

TEST_F(NearFieldTest, HasTheSpringsOfTheTriangleOnly) {
  near_.follow(model_.view, 0);  // nodes 0, 1, 2
  EXPECT_EQ(near_.springs(), 6u);
  model_.view.springs = 1;  // between 0 and 1
  near_.bind();
  EXPECT_TRUE(near_.is_empty());
  near_.follow(model_.view, 1);  // 0, 2, 3
  EXPECT_EQ(near_.springs(), 1u);
}

// Before the first contact nothing is evaluated; the first positions then say nothing of velocity.
TEST_F(NearFieldTest, TakesNodesToRestAfterAPause) {
  std::array<Vec3f, kMaxSurfaceNodes> position_m{};
  for (std::size_t n = 0; n < 4; ++n) position_m[n] = start_m(n) + random_vector(4e-3f);
  near_.follow(model_.view, 0);
  near_.skip();
  near_.evaluate(model_.view, position_m, 2, 2.0f);
  const auto resting = near_.force_N();
  near_.evaluate(model_.view, position_m, 2, 2.0f);  // they have not moved
  for (std::size_t n = 0; n < 4; ++n) EXPECT_EQ(near_.force_N()[n], resting[n]);
}

// What the modes get is Phi' g, acting from the second step on.
TEST_F(NearFieldTest, ReachesTheModes) {
  for (std::size_t m = 0; m < 12; ++m) model_.state.q[m] = 3e-5f * static_cast<float>(m % 5);
  model_.state.p = {};
  const ModalState start = model_.state;
  ModalSurface with, without;
  ModalState plain = start;
  LocalModelView no_springs = model_.view;
  no_springs.springs = 0;
  with.bind(model_.view, model_.state);
  without.bind(no_springs, plain);
  with.prepare(0);
  std::array<Vec3f, kMaxSurfaceNodes> position_m{};
  for (std::uint32_t n = 0; n < 4; ++n) position_m[n] = with.position(n);
  near_.bind();
  for (std::uint32_t n = 0; n < 4; ++n) near_.start_with(model_.view, n, {});
  near_.follow(model_.view, 0);
  near_.evaluate(model_.view, position_m, 1, 2.0f);  // the first of a model
  const auto force = near_.force_N();

  with.advance();
  without.advance();
  EXPECT_EQ(model_.state.q, plain.q);
  EXPECT_EQ(model_.state.p, plain.p);
  with.advance();
  without.advance();
  // After the projection: force in the middle of two steps f, before it 0, so f - f/4 in the first of them.
  double largest = 0;
  for (std::size_t m = 0; m < 12; ++m) {
    double modal = 0;
    for (std::size_t row = 0; row < 12; ++row)
      modal += static_cast<double>(model_.basis[row * 12 + m]) * static_cast<double>(model_.scale[m]) *
               static_cast<double>(force[row / 3][row % 3]);
    const double expected = 0.75 * modal * static_cast<double>(model_.coefficient[6 * m + 5]);
    EXPECT_NEAR(static_cast<double>(model_.state.p[m]) - static_cast<double>(plain.p[m]), expected, 1e-5)
        << "mode " << m;
    largest = std::max(largest, std::abs(expected));
  }
  EXPECT_GT(largest, 1e-3);
}

}  // namespace
}  // namespace palpate
