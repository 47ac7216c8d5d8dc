#include "shared/model/modal_surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "shared/model/test_model.hpp"

namespace palpate {
namespace {

static_assert(ContactSurface<ModalSurface>);

// float has 24 bits; sums of some tens of terms lose a few of them.
constexpr double kFloatSum = 1e-5;
// Positions: modes quantized to 16 bits (ModalSurface::quantize), relative to the displacement.
constexpr double kQuantization = 1e-4;

TEST(ModalSurface, FreeStepIsTheMatrixExponential) {
  test::TestModel model(1e-3, 5, 2000, 0.7);
  ModalSurface surface;
  for (std::size_t m = 0; m < model.view.modes; ++m) {
    model.state.q[m] = 1e-4f * static_cast<float>(m + 1);
    model.state.p[m] = 1e-2f * static_cast<float>(12 - m);
    model.load[m] = 0.5f;
  }
  const ModalState start = model.state;
  surface.bind(model.view, model.state);
  constexpr int kTicks = 100;
  for (int i = 0; i < kTicks; ++i) surface.advance();
  for (std::size_t m = 0; m < model.view.modes; ++m) {
    const double omega = 5 * std::pow(2000.0 / 5, static_cast<double>(m) / 11);
    const auto c = test::exact_coefficients(omega * omega, 2 * 0.7 * omega * omega / 2000, kTicks * 1e-3);
    const double q = start.q[m], p = start.p[m];
    const double expected = q + c[0] * q + c[1] * p + c[4] * 0.5;
    const double size = std::abs(q) + std::abs(p) / omega + 0.5 / (omega * omega);
    EXPECT_NEAR(model.state.q[m], expected, 1e-4 * size) << "mode " << m;
  }
}

TEST(ModalSurface, NodesMoveByTheBasis) {
  test::TestModel model(1e-3, 50, 1500, 1.0);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(-1e-4f, 1e-4f);
  for (auto& q : model.state.q) q = uniform(random);
  ModalSurface surface;
  surface.bind(model.view, model.state);
  for (std::uint32_t node = 0; node < 4; ++node) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double expected = model.position_m[3 * node + axis];
      for (std::size_t m = 0; m < 12; ++m)
        expected += static_cast<double>(model.basis[(3 * node + axis) * 12 + m]) *
                    static_cast<double>(model.scale[m]) * static_cast<double>(model.state.q[m]);
      EXPECT_NEAR(surface.position(node)[axis], expected, kQuantization * 1.3e-3);
    }
  }
}

TEST(ModalSurface, ResponsePredictsWhatApplyDoes) {
  test::TestModel model(1e-3, 50, 1500, 1.0);
  for (auto& p : model.state.p) p = 1e-3f;
  ModalSurface surface;
  surface.bind(model.view, model.state);
  surface.advance();
  const Vec3f barycentric{0.2f, 0.3f, 0.5f}, force{0.3f, -0.2f, -1.0f};
  const auto response = surface.respond(1, barycentric);
  // y = position + half a tick of velocity, from the modal state itself, in double.
  const auto output = [&] {
    Vec3d y{};
    const auto corner = surface.corners(1);
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double sum = model.position_m[3 * corner[k] + axis];
        for (std::size_t m = 0; m < 12; ++m)
          sum += static_cast<double>(model.basis[(3 * corner[k] + axis) * 12 + m]) *
                 static_cast<double>(model.scale[m]) *
                 (static_cast<double>(model.state.q[m]) + 0.5e-3 * static_cast<double>(model.state.p[m]));
        y[axis] += static_cast<double>(barycentric[k]) * sum;
      }
    return y;
  };
  const Vec3d before = output();
  surface.apply(1, barycentric, force);
  const Vec3d moved = output() - before;
  const Vec3f predicted = response.compliance_m_N * force;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(response.free_m[axis], before[axis], kFloatSum * 1e-2);
    EXPECT_NEAR(predicted[axis], moved[axis], kFloatSum * norm(moved));
  }
}

TEST(ModalSurface, FindsNeighboursAndBorder) {
  test::TestModel model(1e-3, 50, 1500, 1.0);
  ModalSurface surface;
  surface.bind(model.view, model.state);
  EXPECT_EQ(surface.neighbour(0, 1), 1);  // across the edge from corner 2 to corner 0
  EXPECT_EQ(surface.neighbour(1, 2), 0);
  EXPECT_EQ(surface.neighbour(0, 0), kNoTriangle);
  EXPECT_EQ(surface.neighbour(1, 1), kNoTriangle);
}

// A node's normal is that of the triangles around it as they are, at most kNormalLifetime_steps old, also
// where the nodes around are not asked for by anybody else.
TEST(ModalSurface, NormalsFollowTheNodesAround) {
  test::TestModel model(1e-3, 20, 60, 1.0);
  for (std::size_t m = 0; m < 12; ++m) model.state.p[m] = 4e-4f * static_cast<float>(m % 3);
  ModalSurface surface;
  surface.bind(model.view, model.state);
  ModalState twin_state = model.state;
  ModalSurface twin;  // asked for every node before every step
  twin.bind(model.view, twin_state);
  // Slow modes: in four steps a normal turns by less than this.
  constexpr float kTurn = 0.01f;
  const Vec3f start = [&] {
    for (std::uint32_t n = 0; n < 4; ++n) (void)twin.position(n);
    const Vec3f a = twin.position(0);
    return normalized(cross(twin.position(1) - a, twin.position(2) - a));
  }();
  float moved = 0;
  for (int step = 0; step < 60; ++step) {
    surface.prepare(0);
    for (std::uint32_t n = 0; n < 4; ++n) (void)twin.position(n);
    surface.advance();
    twin.advance();
    // At corner 0 of the square both triangles count, corner 3 among them, which triangle 0 has not.
    const Vec3f a = twin.position_before(0);
    const Vec3f expected = normalized(cross(twin.position_before(1) - a, twin.position_before(2) - a) +
                                      cross(twin.position_before(2) - a, twin.position_before(3) - a));
    EXPECT_LT(norm(surface.normal_before(0, {1, 0, 0}) - expected), kTurn) << "step " << step;
    moved = std::max(moved, norm(expected - start));
  }
  EXPECT_GT(moved, 3 * kTurn);
}

TEST(ModalSurface, AFlatSurfaceHasTheNormalsOfItsTriangles) {
  test::TestModel model(1e-3, 20, 60, 1.0);
  for (std::size_t m = 0; m < 12; ++m) model.state.q[m] = 2e-5f * static_cast<float>(m % 3);
  model.view.surface = SurfaceKind::flat;
  ModalSurface surface;
  surface.bind(model.view, model.state);
  for (std::uint32_t t = 0; t < 2; ++t) {
    surface.prepare(t);
    surface.advance();
    const auto corner = surface.corners(t);
    const Vec3f a = surface.position_before(corner[0]);
    const Vec3f expected =
        normalized(cross(surface.position_before(corner[1]) - a, surface.position_before(corner[2]) - a));
    EXPECT_LT(norm(surface.normal_before(t, {0.5f, 0.2f, 0.3f}) - expected), 1e-6f);  // some roundings
  }
}

// Dragged over the diagonal and back: each step has the friction of the triangle on which it begins, and
// keeps to its cone.
TEST(ModalSurface, EachTriangleHasItsOwnFriction) {
  test::TestModel model(1e-3, 100, 1000, 1.0);
  model.static_friction = {0.3f, 0.9f};
  model.kinetic_friction = {0.2f, 0.7f};
  model.triangle_friction = {1, 0};
  model.view.frictions = 2;
  model.view.static_friction = model.static_friction.data();
  model.view.kinetic_friction = model.kinetic_friction.data();
  ModalSurface surface;
  surface.bind(model.view, model.state);
  EXPECT_EQ(surface.friction(0), (Friction<float>{0.9f, 0.7f}));
  EXPECT_EQ(surface.friction(1), (Friction<float>{0.3f, 0.2f}));
  ContactState<float> contact;
  Vec3f tip{0.007f, 0.004f, 0.0005f};
  std::array<int, 2> slipping{}, sticking{}, crossings{};
  constexpr float kCone = static_cast<float>(kFloatSum);
  const auto go = [&](const Vec3f& to, int steps) {
    const Vec3f from = tip;
    for (int i = 1; i <= steps; ++i) {
      const ContactState<float> before = contact;
      const Vec3f next = from + (to - from) * (static_cast<float>(i) / static_cast<float>(steps));
      step_contact(surface, contact, ContactLaw<float>{}, tip, next);
      tip = next;
      if (before.mode == ContactMode::free || contact.mode == ContactMode::free) continue;
      const std::uint32_t t = before.triangle;
      const float pressing_N = -dot(contact.normal, contact.force_N);
      const float along_N = norm(contact.force_N + contact.normal * pressing_N);
      const bool slipped = before.mode == ContactMode::slip;
      const std::size_t pair = model.triangle_friction[t];
      const float mu = model.kinetic_friction[pair], holds = slipped ? mu : model.static_friction[pair];
      if (contact.mode == ContactMode::slip) {
        EXPECT_NEAR(along_N, mu * pressing_N, kCone * pressing_N) << i;
        ++slipping[t];
      } else {
        EXPECT_LE(along_N, (holds + kCone) * pressing_N) << i;
        ++sticking[t];
      }
      if (contact.triangle != t) ++crossings[t];
    }
  };
  go({0.007f, 0.004f, -0.001f}, 200);
  for (int lap = 0; lap < 3; ++lap) {
    go({0.003f, 0.008f, -0.001f}, 300);
    go({0.007f, 0.004f, -0.001f}, 300);
  }
  for (std::size_t t = 0; t < 2; ++t) {
    EXPECT_GT(slipping[t], 300) << t;
    EXPECT_GT(sticking[t], 10) << t;
    EXPECT_EQ(crossings[t], 3) << t;
  }
}

// The contact's inversion of the sampled system must not ring (docs/decisions/contact_output.md): after the
// tip has jumped by 0.1 mm, the alternating part of the force is below 1 % of the jump's first force within
// ten ticks.
class NoRinging : public ::testing::TestWithParam<double> {};

TEST_P(NoRinging, AfterATipStep) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    test::TestModel model(1e-3, 100, 1000, GetParam(), seed);
    model.static_friction = model.kinetic_friction = {1e6f};  // sticks throughout
    ModalSurface surface;
    surface.bind(model.view, model.state);
    ContactState<float> contact;
    contact.mode = ContactMode::stick;
    contact.barycentric = {0.3f, 0.3f, 0.4f};
    const ContactLaw<float> law{};
    // Press slowly, then jump: no separation may hide the response.
    Vec3f tip{0.007f, 0.004f, 0.0f};
    constexpr int kPress = 3000;
    for (int i = 1; i <= kPress; ++i) {
      const Vec3f next{0.007f, 0.004f, -0.004f * static_cast<float>(i) / kPress};
      step_contact(surface, contact, law, tip, next);
      tip = next;
    }
    ASSERT_EQ(contact.mode, ContactMode::stick);
    std::array<float, 32> force{};
    for (float& f : force) {
      const Vec3f next{0.007f, 0.004f, -0.0041f};
      step_contact(surface, contact, law, tip, next);
      tip = next;
      f = contact.force_N.z;
    }
    // Eighth difference / 256: the amplitude of an alternating sequence. A mode at 1 rad per tick, which may
    // well ring on at low damping, counts with sin(1/2)^8 = 0.3 %.
    constexpr std::array<float, 9> kBinomial{1, -8, 28, -56, 70, -56, 28, -8, 1};
    const auto alternating = [&](std::size_t i) {
      float sum = 0;
      for (std::size_t k = 0; k < kBinomial.size(); ++k) sum += kBinomial[k] * force[i + k];
      return std::abs(sum) / 256.0f;
    };
    const float first = std::abs(force[0] - force[31]);
    for (std::size_t i = 10; i < 22; ++i)
      EXPECT_LT(alternating(i), 0.01f * first) << "seed " << seed << " tick " << i;
  }
}
INSTANTIATE_TEST_SUITE_P(DampingRatios, NoRinging, ::testing::Values(0.001, 0.01, 0.1, 0.5, 1.0, 2.0));

}  // namespace
}  // namespace palpate
