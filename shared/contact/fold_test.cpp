#include "shared/contact/fold.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

#include "shared/contact/surface_kind.hpp"

namespace palpate::contact_detail {
namespace {

// The solver's own: a hundred-thousandth of the gap, of the way from the contact point.
constexpr double kWay = 1e-5;

class FoldTest : public ::testing::Test {
 protected:
  std::mt19937 random_{11};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};

  Vec3d vector() { return {uniform_(random_), uniform_(random_), uniform_(random_)}; }
  double share() { return 0.5 * (1.0 + uniform_(random_)); }
  // Symmetric, condition number up to about three.
  Mat3d compliance() {
    Mat3d c = Mat3d::identity(2e-3);
    for (int i = 0; i < 2; ++i) {
      const Vec3d v = vector();
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t k = 0; k < 3; ++k) c(r, k) += 1e-3 * v[r] * v[k];
    }
    return c;
  }
  // Planes at 10 to 60 degrees to the first, and at least 10 to each other; of all but the first half go
  // through the contact point.
  Fold<double> fold(std::uint32_t count) {
    constexpr double kTenDegrees = 0.1745;
    Fold<double> fold;
    const Vec3d own = normalized(vector());
    fold.plane[fold.count++] = {own, 0.0};
    while (fold.count < count) {
      const Vec3d v = vector();
      const Vec3d beside = normalized(v - own * dot(own, v));
      const double angle = kTenDegrees * (1.0 + 5.0 * share());
      const Vec3d normal = own * std::cos(angle) + beside * std::sin(angle);
      bool apart = true;
      for (std::uint32_t i = 0; i < fold.count; ++i)
        apart = apart && norm(cross(normal, fold.plane[i].normal)) > std::sin(kTenDegrees);
      if (apart) fold.plane[fold.count++] = {normal, uniform_(random_) < 0 ? 0.0 : share() * 1e-3};
    }
    return fold;
  }
};

// The least sine between two planes, and the least volume that three normals span.
double apart(const Fold<double>& fold) {
  double least = 1.0;
  for (std::uint32_t i = 0; i < fold.count; ++i)
    for (std::uint32_t j = i + 1; j < fold.count; ++j) {
      const Vec3d edge = cross(fold.plane[i].normal, fold.plane[j].normal);
      least = std::min(least, norm(edge));
      for (std::uint32_t k = j + 1; k < fold.count; ++k)
        least = std::min(least, std::abs(dot(edge, fold.plane[k].normal)));
    }
  return least;
}

// u of least index set, of at most three planes, with N' C N u = -(N' gap + h) on it, u >= 0, and every plane
// in front: the frictionless problem by trying all. Its force is unique, for the compliance is definite.
bool try_all(const Vec3d& gap, const Mat3d& c, const Fold<double>& fold, Vec3d& force) {
  for (std::uint32_t set = 0; set < 1u << fold.count; ++set) {
    std::array<std::uint32_t, 3> member{};
    std::uint32_t size = 0, others = set;
    for (std::uint32_t i = 0; i < fold.count && size <= 3; ++i, others >>= 1)
      if ((others & 1u) != 0 && size++ < 3) member[size - 1] = i;
    if (size > 3) continue;
    Mat3d m = Mat3d::identity();
    Vec3d right{}, u{};
    for (std::uint32_t r = 0; r < size; ++r) {
      const auto& p = fold.plane[member[r]];
      right[r] = -(dot(p.normal, gap) + p.height_m);
      for (std::uint32_t k = 0; k < size; ++k) m(r, k) = dot(p.normal, c * fold.plane[member[k]].normal);
    }
    if (!solve(m, right, u, 1e-15) || u.x < 0 || u.y < 0 || u.z < 0) continue;
    force = {};
    for (std::uint32_t k = 0; k < size; ++k) force -= fold.plane[member[k]].normal * u[k];
    const Vec3d s = gap - c * force;
    bool in_front = true;
    for (std::uint32_t i = 0; i < fold.count; ++i)
      in_front = in_front && dot(fold.plane[i].normal, s) + fold.plane[i].height_m > -kWay * norm(gap);
    if (in_front) return true;
  }
  return false;
}

TEST_F(FoldTest, WithoutFrictionItIsTheComplementarySolution) {
  std::array<int, 3> seen{};
  for (int trial = 0; trial < 20000; ++trial) {
    const Mat3d c = compliance();
    const Fold<double> f = fold(1 + static_cast<std::uint32_t>(trial) % kMaxFoldPlanes);
    const Vec3d gap = vector() * 1e-3;
    const auto result = FoldSolver<double>(gap, c, f, {0.0, 0.0}, ContactMode::slip).solve();
    ++seen[static_cast<std::size_t>(result.contact.mode)];
    Vec3d expected{};
    ASSERT_TRUE(try_all(gap, c, f, expected));
    // The tip may be behind planes by kWay of the gap. With a compliance of at least 2 mm/N, and how far
    // planes are from having no edge or no corner, that bounds the force.
    const double bound_N = kWay * norm(gap) / (2e-3 * apart(f) * apart(f));
    EXPECT_LE(norm(result.contact.force_N - expected), bound_N) << trial;
    const Vec3d s = gap - c * result.contact.force_N;
    for (std::uint32_t i = 0; i < f.count; ++i)
      EXPECT_GE(dot(f.plane[i].normal, s) + f.plane[i].height_m, -2.0 * kWay * norm(gap)) << trial;
  }
  for (const int count : seen) EXPECT_GT(count, 50);
}

// The share of `force` that no u_i (mu d_i - n_i) with u_i >= 0 explains, where i goes over the planes that
// the tip touches, d_i is the direction of s in plane i, and at most three planes press.
double unexplained(const Vec3d& force, const Vec3d& s, const Fold<double>& fold, double mu, double reach_m) {
  double least = 1.0;
  std::array<Vec3d, kMaxFoldPlanes> push{};
  std::uint32_t touched = 0;
  for (std::uint32_t i = 0; i < fold.count; ++i) {
    const Vec3d& n = fold.plane[i].normal;
    if (std::abs(dot(n, s) + fold.plane[i].height_m) > reach_m) continue;
    push[touched++] = normalized(s - n * dot(n, s)) * mu - n;
  }
  for (std::uint32_t set = 1; set < 1u << touched; ++set) {
    std::array<Vec3d, 3> p{};
    std::uint32_t size = 0;
    for (std::uint32_t i = 0; i < touched; ++i)
      if ((set >> i & 1u) != 0 && size++ < 3) p[size - 1] = push[i];
    if (size > 3) continue;
    Mat3d m = Mat3d::identity();
    Vec3d right{}, u{};
    for (std::uint32_t r = 0; r < size; ++r) {
      right[r] = dot(p[r], force);
      for (std::uint32_t k = 0; k < size; ++k) m(r, k) = dot(p[r], p[k]);
    }
    if (!solve(m, right, u, 1e-15) || u.x < 0 || u.y < 0 || u.z < 0) continue;
    least = std::min(least, norm(force - p[0] * u.x - p[1] * u.y - p[2] * u.z) / norm(force));
  }
  return least;
}

// The share of `force` outside the sum of the planes' friction cones, by projections to them in turn.
double outside_cones(const Vec3d& force, const Fold<double>& fold, double mu, double reach_m) {
  std::array<Vec3d, kMaxFoldPlanes> part{};
  Vec3d left = force;
  for (int round = 0; round < 500; ++round) {
    for (std::uint32_t i = 0; i < fold.count; ++i) {
      if (fold.plane[i].height_m > reach_m) continue;
      const Vec3d& n = fold.plane[i].normal;
      const Vec3d wanted = left + part[i];
      const double pressing = -dot(n, wanted);
      const Vec3d drag = wanted + n * pressing;
      Vec3d nearest = wanted;
      if (norm(drag) > mu * pressing) {
        const double u = std::max(0.0, (pressing + mu * norm(drag)) / (1.0 + mu * mu));
        nearest = normalized(drag) * (mu * u) - n * u;
      }
      left = wanted - nearest;
      part[i] = nearest;
    }
  }
  return norm(left) / norm(force);
}

TEST_F(FoldTest, WithFrictionPlanesAreKeptAndForcesStayInTheirCones) {
  // Friction's direction is known to kSlipConverged, 2.6 degrees; kConeExcess is 1 %.
  constexpr double kDirection = 0.05, kExcess = 0.011;
  std::array<int, 3> seen{};
  int unsolved = 0;
  constexpr int kTrials = 20000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Mat3d c = compliance();
    const Fold<double> f = fold(2 + static_cast<std::uint32_t>(trial) % 3);
    const Vec3d gap = vector() * 1e-3;
    const double mu = share(), way_m = kWay * norm(gap);
    const auto result = FoldSolver<double>(gap, c, f, {mu, mu}, ContactMode::slip).solve();
    const Vec3d& force = result.contact.force_N;
    ++seen[static_cast<std::size_t>(result.contact.mode)];
    if (result.contact.mode == ContactMode::free) {
      EXPECT_EQ(force, Vec3d{});
      continue;
    }
    const Vec3d s = gap - c * force;
    for (std::uint32_t i = 0; i < f.count; ++i)
      EXPECT_GE(dot(f.plane[i].normal, s) + f.plane[i].height_m, -2.0 * way_m) << trial;
    // The tip gives the contact more than the body gets.
    EXPECT_GE(dot(force, s), -2.0 * way_m * norm(force)) << trial;
    const bool moves = result.contact.mode == ContactMode::slip;
    const double wrong =
        moves ? unexplained(force, s, f, mu, 20.0 * way_m) : outside_cones(force, f, mu, 1e-3);
    unsolved += wrong > (moves ? kDirection : kExcess);
  }
  for (const int count : seen) EXPECT_GT(count, 500);
  // Three planes in whose corner it sticks by friction are not told apart from two in whose edge it creeps.
  EXPECT_LE(unsolved, kTrials / 1000);
}

TEST_F(FoldTest, OnePlaneIsSolveCoulomb) {
  for (int trial = 0; trial < 1000; ++trial) {
    const Mat3d c = compliance();
    const Fold<double> f = fold(1);
    const Vec3d gap = vector() * 1e-3;
    const auto expected = solve_coulomb(gap, c, f.plane[0].normal, {0.4, 0.3}, ContactMode::stick);
    const auto result = FoldSolver<double>(gap, c, f, {0.4, 0.3}, ContactMode::stick).solve();
    EXPECT_EQ(result.contact.mode, expected.mode);
    EXPECT_EQ(result.contact.force_N, expected.force_N);
    EXPECT_EQ(result.normal, f.plane[0].normal);
  }
}

// Two triangles of 1 cm with a common edge along y; the second goes up from it by `slope`.
struct Roof {
  using Real = double;
  double slope = 0;

  static std::array<std::uint32_t, 3> corners(std::uint32_t t) {
    return t == 0 ? std::array<std::uint32_t, 3>{0, 1, 2} : std::array<std::uint32_t, 3>{1, 3, 2};
  }
  static std::int32_t neighbour(std::uint32_t t, std::uint32_t c) {
    return t == 0 && c == 0 ? 1 : t == 1 && c == 1 ? 0 : kNoTriangle;
  }
  [[nodiscard]] Vec3d position(std::uint32_t n) const {
    const std::array<Vec3d, 4> x{{{-0.01, 0, 0}, {0, 0, 0}, {0, 0.01, 0}, {0.01, 0, 0.01 * slope}}};
    return x[n];
  }
  [[nodiscard]] Vec3d position_before(std::uint32_t n) const { return position(n); }
  [[nodiscard]] Vec3d normal_before(std::uint32_t t, const Vec3d&) const {
    const auto c = corners(t);
    return normalized(cross(position(c[1]) - position(c[0]), position(c[2]) - position(c[0])));
  }
};

TEST(FoldAt, HasTheNeighbourThatRisesWithinReach) {
  Roof roof{0.5};
  const Vec3d place{0.2, 0.5, 0.3};  // 2 mm from the edge
  const auto fold = fold_at(roof, 0u, place, roof.normal_before(0u, place), 0.0, 1.0);
  ASSERT_EQ(fold.count, 2u);
  EXPECT_EQ(fold.plane[0].normal, (Vec3d{0, 0, 1}));
  EXPECT_EQ(fold.plane[0].height_m, 0.0);
  const Vec3d normal = normalized(Vec3d{-0.5, 0, 1});
  EXPECT_NEAR(norm(fold.plane[1].normal - normal), 0.0, 1e-12);
  EXPECT_NEAR(fold.plane[1].height_m, 0.002 * 0.5 / std::sqrt(1.25), 1e-12);
  // A sphere of 1 mm, over the same place, is closer to it.
  EXPECT_NEAR(fold_at(roof, 0u, place, roof.normal_before(0u, place), 0.001, 1.0).plane[1].height_m,
              fold.plane[1].height_m - 0.001 * (1.0 - normal.z), 1e-12);
  EXPECT_EQ(fold_at(roof, 0u, place, roof.normal_before(0u, place), 0.0, 1e-4).count, 1u);
  roof.slope = -0.5;
  EXPECT_EQ(fold_at(roof, 0u, place, roof.normal_before(0u, place), 0.0, 1.0).count, 1u);
  roof.slope = 0.0;
  EXPECT_EQ(fold_at(roof, 0u, place, roof.normal_before(0u, place), 0.0, 1.0).count, 1u);
}

}  // namespace
}  // namespace palpate::contact_detail
