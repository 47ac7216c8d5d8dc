// A sphere rolls over the square edges of a lattice's body at its radius.
#include "shared/contact/ball.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "shared/contact/contact.hpp"
#include "shared/contact/test_grid.hpp"

namespace palpate {
namespace {

constexpr double kCell_m = 0.01, kSide_m = 0.03, kRadius_m = 0.003, kDepth_m = 5e-5;
constexpr double kStiffness_N_m = 1000.0, kStep_s = 1e-3, kStep_m = 2e-5;

// A cube of 3x3x3 cells that gives way at the contact point only.
class Cube {
 public:
  using Real = double;
  [[nodiscard]] static constexpr double target_extrapolation() { return 0.0; }
  explicit Cube(SurfaceKind kind) : kind_(kind) {
    for (int axis = 0; axis < 3; ++axis)
      for (const bool far : {false, true})
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i) {
            const auto node = [&](int u, int v) {
              std::array<int, 3> at{};
              at[static_cast<std::size_t>(axis)] = far ? 3 : 0;
              at[static_cast<std::size_t>((axis + 1) % 3)] = u;
              at[static_cast<std::size_t>((axis + 2) % 3)] = v;
              return static_cast<std::uint32_t>(at[0] + 4 * at[1] + 16 * at[2]);
            };
            const auto a = node(i, j), b = node(i + 1, j), c = node(i + 1, j + 1), d = node(i, j + 1);
            if (far) {
              corners_.push_back({a, b, c});
              corners_.push_back({a, c, d});
            } else {
              corners_.push_back({a, c, b});
              corners_.push_back({a, d, c});
            }
          }
  }
  static constexpr double step_s() { return kStep_s; }
  SurfaceKind kind() const { return kind_; }
  std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(corners_.size()); }
  std::array<std::uint32_t, 3> corners(std::uint32_t t) const { return corners_[t]; }
  std::int32_t neighbour(std::uint32_t t, std::uint32_t c) const {
    return test::neighbour_across(corners_, t, c);
  }
  Friction<double> friction(std::uint32_t) const { return {}; }
  Nearness nearness(const Vec3d&, const Vec3d&, double) { return Nearness::near; }
  bool may_touch(std::uint32_t, const Vec3d&, const Vec3d&, double) const { return true; }
  void note_clearance(double) {}
  void prepare(std::uint32_t) {}
  Vec3d position(std::uint32_t node) const {
    return Vec3d{static_cast<double>(node % 4), static_cast<double>(node / 4 % 4),
                 static_cast<double>(node / 16)} *
           kCell_m;
  }
  Vec3d position_before(std::uint32_t node) const { return position(node); }
  Vec3d area(std::uint32_t t) const {
    const auto& c = corners_[t];
    return cross(position(c[1]) - position(c[0]), position(c[2]) - position(c[0]));
  }
  Vec3d normal_before(std::uint32_t t, const Vec3d& barycentric) const {
    if (kind_ == SurfaceKind::flat) return normalized(area(t));
    Vec3d sum{};
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3d at_node{};
      for (std::uint32_t other = 0; other < corners_.size(); ++other)
        for (const std::uint32_t node : corners_[other])
          if (node == corners_[t][k]) at_node += area(other);
      sum += normalized(at_node) * barycentric[k];
    }
    return normalized(sum);
  }
  void advance() {}
  Vec3d point(std::uint32_t t, const Vec3d& b) const {
    const auto& c = corners_[t];
    return position(c[0]) * b.x + position(c[1]) * b.y + position(c[2]) * b.z;
  }
  PointResponse<double> respond(std::uint32_t t, const Vec3d& b) const {
    return {point(t, b), Mat3d::identity(1.0 / kStiffness_N_m), 0.0};
  }
  void apply(std::uint32_t, const Vec3d&, const Vec3d&) {}
  // From the cube, outside of it.
  static double distance_m(const Vec3d& x) {
    Vec3d away{};
    for (std::size_t k = 0; k < 3; ++k) away[k] = std::max({x[k] - kSide_m, -x[k], 0.0});
    return norm(away);
  }

 private:
  SurfaceKind kind_;
  std::vector<std::array<std::uint32_t, 3>> corners_;
};
static_assert(ContactSurface<Cube>);

class RollingBall : public ::testing::TestWithParam<SurfaceKind> {};

// Over the top, around the edge, down the side, on a way that a sphere pressed in by kDepth_m would roll;
// aslant, too, and past the corner.
TEST_P(RollingBall, KeepsItsRadiusAroundASquareEdge) {
  constexpr double kReach_m = kRadius_m - kDepth_m, kBefore_m = 0.012,
                   kArc_m = kReach_m * std::numbers::pi / 2.0, kWay_m = 0.028;
  const ContactLaw<double> law{.tip_radius_m = kRadius_m};
  for (const double aside_m : {0.013, 0.0171, 0.0295}) {
    for (const double aslant : {0.0, 0.1}) {
      SCOPED_TRACE(::testing::Message() << aside_m << " m, " << aslant);
      const auto way_m = [&](double s) {
        const double around = std::clamp(s - kBefore_m, 0.0, kArc_m) / kReach_m;
        return Vec3d{kSide_m - kBefore_m + std::min(s, kBefore_m) + kReach_m * std::sin(around),
                     aside_m + aslant * s,
                     kSide_m + kReach_m * std::cos(around) - std::max(s - kBefore_m - kArc_m, 0.0)};
      };
      Cube cube(GetParam());
      ContactState<double> state;
      Vec3d tip = way_m(0.0) + Vec3d{0, 0, 1e-4}, before_N{};
      bool around_corner = false;
      for (int i = 0; i * kStep_m < kWay_m; ++i) {
        const Vec3d next = way_m(i * kStep_m);
        step_contact(cube, state, law, tip, next);
        const double step_m = norm(next - tip);
        tip = next;
        // A step of the centre along the tangent takes it away by step^2 / (2 radius). Where the way leads
        // past the corner it leaves the cube.
        const double overlap_m = std::max(kRadius_m - Cube::distance_m(tip), 0.0);
        const double curved_m = i > 0 ? step_m * step_m / (2.0 * kReach_m) : kDepth_m / 128.0;
        EXPECT_NEAR(norm(state.force_N), kStiffness_N_m * overlap_m, 1.01 * kStiffness_N_m * curved_m) << i;
        around_corner |= overlap_m < 0.5 * kDepth_m;
        // The force turns with the centre.
        if (i > 0 && overlap_m > 0.5 * kDepth_m) {
          EXPECT_LE(norm(state.force_N - before_N), 1.1 * kStiffness_N_m * kDepth_m * step_m / kReach_m) << i;
        }
        before_N = state.force_N;
      }
      EXPECT_EQ(around_corner, aside_m > 0.029 && aslant > 0.0);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Kind, RollingBall, ::testing::Values(SurfaceKind::smooth, SurfaceKind::flat));

}  // namespace
}  // namespace palpate
