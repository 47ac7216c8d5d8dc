// The shared `paper` mode against the operators as matrices.
#include "shared/contact/paper_contact.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "host/reference/paper_reference.hpp"
#include "host/reference/patch_arrays.hpp"
#include "host/reference/test_patches.hpp"
#include "shared/contact/linear_patch.hpp"

namespace palpate::host::paper {
namespace {

constexpr std::size_t kCapacity = 32;
using DoublePatch = palpate::LinearPatch<double, kCapacity>;
using FloatPatch = palpate::LinearPatch<float, kCapacity>;
static_assert(PaperPatch<DoublePatch>);
static_assert(PaperPatch<FloatPatch>);

Vec3d to_vec3(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}
template <class Real>
Vec3<Real> cast(const Vec3d& v) {
  return {static_cast<Real>(v.x), static_cast<Real>(v.y), static_cast<Real>(v.z)};
}
template <class Real>
double distance(const Vec3<Real>& a, const Vec3d& b) {
  return norm(Vec3d{static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)} - b);
}

// An instrument that passes the patch's triangle within a step.
struct Situation {
  LinearPatch patch;
  PaperLaw<double> law;
  InstrumentStep motion;
};

Situation random_situation(test::Random& random) {
  Situation s;
  s.patch = test::random_patch(random);
  const double kinds = random(0, 4);
  s.law.kind = kinds < 1   ? PaperFriction::sticking
               : kinds < 2 ? PaperFriction::frictionless
                           : PaperFriction::coulomb;
  s.law.friction = random(0, 2);
  s.law.point = random(0, 1) < 0.5 ? PaperPointVelocity::held : PaperPointVelocity::carried;
  s.motion.step_s = std::pow(10.0, random(-5, -3));

  const auto& corner = s.patch.corner.front();
  const auto x = [&](std::size_t k) -> Eigen::Vector3d {
    return s.patch.rest_position_m.segment<3>(3 * static_cast<Eigen::Index>(corner[k]));
  };
  const auto v = [&](std::size_t k) -> Eigen::Vector3d {
    return s.patch.rest_velocity_m_s.segment<3>(3 * static_cast<Eigen::Index>(corner[k]));
  };
  const Eigen::Vector3d w = 0.9 * random.barycentric() + Eigen::Vector3d::Constant(0.1 / 3);
  const Eigen::Vector3d point = w[0] * x(0) + w[1] * x(1) + w[2] * x(2);
  const Eigen::Vector3d point_velocity = w[0] * v(0) + w[1] * v(1) + w[2] * v(2);
  const Eigen::Vector3d normal = (x(1) - x(0)).cross(x(2) - x(0)).normalized();
  // Relative to the surface, whose forces accelerate it by up to some km/s^2.
  const double h = s.motion.step_s, reach = 5e3 * h * h;
  Eigen::Vector3d across = random.vector(3, 1.0);
  across -= normal * normal.dot(across);
  s.motion.from_m = point + normal * random(0.01, 0.1) * h;
  s.motion.to_m = point + point_velocity * h + across * 0.1 * h - normal * (reach + random(0.01, 0.5) * h);
  return s;
}

template <class Patch>
void expect_equal_state(const Patch& patch, const PatchState& expected, double tolerance_m,
                        double tolerance_m_s) {
  for (std::uint32_t n = 0; n < patch.node_count(); ++n) {
    const auto row = 3 * static_cast<Eigen::Index>(n);
    EXPECT_LT(distance(patch.position(n), to_vec3(expected.x_m.segment<3>(row))), tolerance_m) << n;
    EXPECT_LT(distance(patch.velocity(n), to_vec3(expected.v_m_s.segment<3>(row))), tolerance_m_s) << n;
  }
}

double largest_entry(const Eigen::VectorXd& v) {
  return v.cwiseAbs().maxCoeff();
}

// Which of the two forces (4) takes is a matter of rounding within this relative distance from the cone.
bool at_cone(const Situation& s, const PaperContactState<double>& contact, double resolution) {
  if (s.law.kind != PaperFriction::coulomb) return false;
  const Vec3d along = contact.normal * dot(contact.normal, contact.instrument_force_N);
  const double tangential = norm(contact.instrument_force_N - along);
  return std::abs(tangential - s.law.friction * norm(along)) <= resolution * norm(contact.instrument_force_N);
}

struct Agreement {
  int compared = 0, stick = 0, slip = 0, skipped = 0;
};

// Steps the shared code and the matrices `steps` times from many situations. Tolerance: `factor` units of
// rounding of the largest quantity of its kind; forces are sums of 36 products, amplified by 1 / |w|^2 <= 3.
template <class Real>
Agreement compare(unsigned seed, int cases, int steps, double factor) {
  constexpr double kEps = static_cast<double>(std::numeric_limits<Real>::epsilon());
  Agreement result;
  test::Random random(seed);
  for (int i = 0; i < cases && !::testing::Test::HasFailure(); ++i) {
    SCOPED_TRACE(i);
    const Situation s = random_situation(random);
    PaperReference reference(s.patch, s.law);
    const PatchArrays<Real> arrays(s.patch);
    palpate::LinearPatch<Real, kCapacity> patch(arrays.view());
    PaperContactState<Real> state;
    const PaperLaw<Real> law{s.law.kind, static_cast<Real>(s.law.friction), s.law.point};
    InstrumentStep motion = s.motion;
    for (int step = 0; step < steps; ++step) {
      const PatchState before = reference.state();
      reference.step(motion);
      step_paper_contact(patch, state, law, cast<Real>(to_vec3(motion.from_m)),
                         cast<Real>(to_vec3(motion.to_m)), static_cast<Real>(motion.step_s));
      const PaperContactState<double>& expected = reference.contact();
      const bool same_time = std::abs(static_cast<double>(state.collision_s) - expected.collision_s) <
                             0.5 * motion.step_s / (1 << kPaperBisections);
      const double resolution = factor * kEps;
      // A bisection that hits the surface to rounding, or a force on the cone to rounding.
      if (state.mode != expected.mode || !same_time) {
        const bool excused = !same_time || at_cone(s, expected, resolution);
        EXPECT_TRUE(excused);
        ++result.skipped;
        break;
      }
      ++result.compared;
      result.stick += expected.mode == ContactMode::stick;
      result.slip += expected.mode == ContactMode::slip;
      const double length_m = largest_entry(before.x_m);
      const double force_N = largest_entry(s.patch.df_dx_N_m.cwiseAbs() *
                                           (reference.state().x_m - s.patch.rest_position_m).cwiseAbs()) +
                             largest_entry(s.patch.df_dv_N_s_m.cwiseAbs() * before.v_m_s.cwiseAbs()) +
                             largest_entry(s.patch.rest_force_N) +
                             // a position is known to its rounding
                             largest_entry(s.patch.df_dx_N_m.cwiseAbs().rowwise().sum()) * length_m;
      const double speed_m_s = largest_entry(before.v_m_s) + largest_entry(reference.state().v_m_s) +
                               force_N * motion.step_s / s.patch.mass_kg.minCoeff() +
                               length_m / motion.step_s * (s.law.point == PaperPointVelocity::carried);
      expect_equal_state(patch, reference.state(), resolution * (length_m + speed_m_s * motion.step_s),
                         resolution * speed_m_s);
      EXPECT_LT(distance(state.instrument_force_N, expected.instrument_force_N), resolution * force_N);
      EXPECT_LT(distance(state.momentum_force_N, expected.momentum_force_N),
                resolution * (force_N + s.patch.mass_kg.maxCoeff() * speed_m_s / motion.step_s *
                                            (1 << kPaperBisections)));
      const Eigen::Vector3d move = motion.to_m - motion.from_m;
      motion.from_m = motion.to_m;
      motion.to_m += move * 0.3;
    }
  }
  return result;
}

constexpr int kCases = 4000;

TEST(PaperContact, OneStepIsThatOfTheMatrices) {
  const Agreement a = compare<double>(1, kCases, 1, 300);
  EXPECT_GT(a.stick, kCases / 5);
  EXPECT_GT(a.slip, kCases / 5);
  EXPECT_LT(a.skipped, kCases / 100);
}

TEST(PaperContact, OneStepInSinglePrecisionToo) {
  const Agreement a = compare<float>(2, kCases, 1, 300);
  EXPECT_GT(a.stick, kCases / 5);
  EXPECT_GT(a.slip, kCases / 5);
  EXPECT_LT(a.skipped, kCases / 20);
}

TEST(PaperContact, SeveralStepsAreThoseOfTheMatrices) {
  const Agreement a = compare<double>(3, 1000, 5, 3000);
  EXPECT_GT(a.stick, 500);
  EXPECT_GT(a.slip, 500);
}

}  // namespace
}  // namespace palpate::host::paper
