// The contact point's way over a surface that is at rest: a dome or a bowl of triangles, with the normals of
// the paraboloid that its nodes lie on.
#include "shared/contact/slide.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shared/contact/collision.hpp"
#include "shared/contact/test_grid.hpp"

namespace palpate {
namespace {

constexpr double kCell_m = 0.01;
constexpr int kSide = 8;
// z = curvature / 2 (x^2 + y^2): triangles that meet are tilted by up to 0.1 against each other.
constexpr double kCurvature_1_m = 10.0;
// Longest edge and the root of twice the area, of the steepest triangle with room to spare.
constexpr double kWidth_m = 1.5 * kCell_m;

class Paraboloid {
 public:
  using Real = double;
  explicit Paraboloid(double curvature_1_m, SurfaceKind kind = SurfaceKind::smooth)
      : curvature_1_m_(curvature_1_m), kind_(kind) {}
  SurfaceKind kind() const { return kind_; }
  std::uint32_t triangle_count() const { return triangles_.count(); }
  std::array<std::uint32_t, 3> corners(std::uint32_t t) const { return triangles_[t]; }
  std::int32_t neighbour(std::uint32_t t, std::uint32_t c) const { return triangles_.neighbour(t, c); }
  Vec3d position(std::uint32_t node) const {
    return at(kCell_m * (node % kSide - 0.5 * (kSide - 1)), kCell_m * (node / kSide - 0.5 * (kSide - 1)));
  }
  Vec3d position_before(std::uint32_t node) const { return position(node); }
  bool may_touch(std::uint32_t, const Vec3d&, const Vec3d&, double) const { return true; }
  void note_clearance(double noted_m) { clearance_m = noted_m; }
  Vec3d at(double x_m, double y_m) const {
    return {x_m, y_m, 0.5 * curvature_1_m_ * (x_m * x_m + y_m * y_m)};
  }
  Vec3d normal(double x_m, double y_m) const {
    return normalized(Vec3d{-curvature_1_m_ * x_m, -curvature_1_m_ * y_m, 1.0});
  }
  Vec3d point(const ContactState<double>& s) const {
    const auto c = triangles_[s.triangle];
    return position(c[0]) * s.barycentric.x + position(c[1]) * s.barycentric.y +
           position(c[2]) * s.barycentric.z;
  }

  double clearance_m = -1.0;

 private:
  double curvature_1_m_;
  SurfaceKind kind_;
  test::GridTriangles triangles_{kSide};
};

// In the middle of the first cell's lower triangle.
ContactState<double> start_on(const Paraboloid& surface) {
  ContactState<double> state;
  state.mode = ContactMode::slip;
  state.barycentric = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
  const Vec3d x = surface.point(state);
  state.normal = surface.normal(x.x, x.y);
  return state;
}

class Slide : public ::testing::TestWithParam<double> {};

// What touches moves at right angles to the normal, but for what is forgotten of the height; that stays below
// the width of a triangle.
TEST_P(Slide, OverASmoothSurfaceIsSquareToTheNormal) {
  Paraboloid surface(GetParam());
  ContactState<double> state = start_on(surface);
  constexpr int kSteps = 600;
  const Vec3d start_m = surface.point(state);
  double largest_m = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double u = static_cast<double>(i) / kSteps;
    const Vec3d before_m = surface.point(state);
    const double height_before_m = state.height_m;
    state.normal = surface.normal(before_m.x, before_m.y);
    const double x_m = start_m.x + 0.06 * u, y_m = start_m.y + 0.023 * u;
    contact_detail::slide(surface, state, surface.at(x_m, y_m));
    const Vec3d moved_m = surface.point(state) - before_m;
    const double rise_m = dot(state.normal, moved_m) + state.height_m - height_before_m;
    // A triangle is at least kCell_m wide; its height before the step differs by the rise itself.
    EXPECT_LE(std::fabs(rise_m), (std::fabs(height_before_m) + norm(moved_m)) * norm(moved_m) / kCell_m) << i;
    largest_m = std::max(largest_m, std::fabs(state.height_m));
  }
  EXPECT_LT(largest_m, kWidth_m);
  // A dome's or bowl's sagitta over an edge of a cell, at least in part.
  EXPECT_GT(largest_m, 0.1 * std::fabs(GetParam()) * kCell_m * kCell_m / 8.0);
}
INSTANTIATE_TEST_SUITE_P(Curvature, Slide, ::testing::Values(-kCurvature_1_m, kCurvature_1_m));

// Whatever it was before: however far the contact point goes, back and forth within a triangle or across.
TEST(SlideHeight, NeverExceedsAWidth) {
  Paraboloid surface(-kCurvature_1_m);
  ContactState<double> state = start_on(surface);
  state.height_m = kCell_m;
  state.normal = normalized(Vec3d{0.8, 0.0, 1.0});  // not the surface's by far
  const Vec3d start_m = surface.point(state);
  for (int i = 0; i < 400; ++i) {
    const double x_m = start_m.x + 0.03 * std::fabs(std::sin(0.07 * i * i));
    contact_detail::slide(surface, state, surface.at(x_m, start_m.y));
    EXPECT_LE(std::fabs(state.height_m), kWidth_m) << i;
  }
}

TEST(SlideHeight, IsNoneOnFlatTrianglesAndWhilePushedOut) {
  for (const bool flat : {false, true}) {
    Paraboloid surface(kCurvature_1_m, flat ? SurfaceKind::flat : SurfaceKind::smooth);
    ContactState<double> state = start_on(surface);
    state.height_m = 1e-4;
    if (!flat) state.inset_m = 1e-3;
    const Vec3d start_m = surface.point(state);
    contact_detail::slide(surface, state, surface.at(start_m.x + 0.004, start_m.y));
    EXPECT_EQ(state.height_m, 0.0);
  }
}

TEST(SlideWay, PassesOverAnyNumberOfEdgesInAStep) {
  for (const SurfaceKind kind : {SurfaceKind::flat, SurfaceKind::smooth}) {
    Paraboloid surface(kCurvature_1_m, kind);
    ContactState<double> state = start_on(surface);
    const Vec3d target_m = surface.at(0.031, 0.0273);  // from corner to corner: 12 edges and more
    contact_detail::slide(surface, state, target_m);
    EXPECT_FALSE(state.at_border);
    EXPECT_LE(norm(surface.point(state) - target_m), kCell_m);
    // So far away the normal of the start leads astray; the next step, with the one of the place, mends that.
    const Vec3d there_m = surface.point(state);
    state.normal = surface.normal(there_m.x, there_m.y);
    const Vec3d short_m = contact_detail::slide(surface, state, target_m);
    constexpr double kSagitta_m = kCurvature_1_m * 2.0 * kCell_m * kCell_m / 8.0;  // over a diagonal
    EXPECT_LE(norm(short_m), 2.0 * kSagitta_m);
    EXPECT_LE(norm(surface.point(state) - target_m), 2.0 * kSagitta_m);
  }
}

// From a node of the border, whichever of its triangles the contact point was in, along each of its edges.
TEST(SlideWay, LeavesANodeOfTheBorderAllWaysRound) {
  const Paraboloid surface(0.0, SurfaceKind::flat);
  for (const std::uint32_t node : {3u, 3u + 7u * kSide, 3u * kSide, 3u * kSide + 7u}) {
    std::vector<std::uint32_t> around;
    for (std::uint32_t t = 0; t < surface.triangle_count(); ++t)
      for (const std::uint32_t corner : surface.corners(t))
        if (corner == node) around.push_back(t);
    ASSERT_EQ(around.size(), 3u);
    for (const std::uint32_t from : around)
      for (const std::uint32_t to : around)
        for (const std::uint32_t along : surface.corners(to)) {
          ContactState<double> state;
          state.triangle = from;
          const auto corner = surface.corners(from);
          for (std::size_t c = 0; c < 3; ++c) state.barycentric[c] = corner[c] == node ? 1.0 : 0.0;
          state.normal = {0.0, 0.0, 1.0};
          const Vec3d start_m = surface.position(node);
          const Vec3d target_m = start_m + (surface.position(along) - start_m) * 0.1;
          contact_detail::slide(surface, state, target_m);
          EXPECT_LE(norm(surface.point(state) - target_m), 1e-12) << node << " " << from << " " << along;
        }
  }
}

// The tip comes back from just above the place that it has left, above or below the triangles.
class Return : public ::testing::TestWithParam<double> {
 protected:
  Return() : surface_(kCurvature_1_m), state_(start_on(surface_)), place_m_(surface_.point(state_)) {
    weights_ = state_.barycentric;
    state_.mode = ContactMode::free;
    state_.outside = true;
    state_.height_m = GetParam();
    state_.barycentric = {};
  }
  Vec3d over(double distance_m) const { return place_m_ + state_.normal * (GetParam() + distance_m); }
  contact_detail::Meeting go(double from_m, double to_m) {
    return contact_detail::find_meeting(surface_, state_,
                                        contact_detail::TipMotion<double>{over(from_m), over(to_m), 0.0});
  }
  Paraboloid surface_;
  ContactState<double> state_;
  Vec3d place_m_, weights_;
};

TEST_P(Return, IsToThePlaceThatWasLeft) {
  constexpr double kNear_m = 2e-5;
  ASSERT_EQ(go(kNear_m, -kNear_m), contact_detail::Meeting::collision);
  EXPECT_EQ(state_.height_m, GetParam());
  // The time of collision is known to a 256th of the step.
  EXPECT_LE(norm(surface_.point(state_) - place_m_), kNear_m / 64.0);
}

TEST_P(Return, IsNotYetWhereTheTipStaysOutside) {
  ASSERT_EQ(go(4e-5, 2e-5), contact_detail::Meeting::none);
  EXPECT_EQ(state_.height_m, GetParam());
  EXPECT_TRUE(state_.outside);
}

// The height is forgotten where the tip is outside of the triangles too, and no collision is due at once.
TEST_P(Return, OfATipThatWasFurtherAwayIsToTheTriangles) {
  const double away_m = 1.5 * std::fabs(GetParam());
  ASSERT_EQ(go(away_m, away_m), contact_detail::Meeting::none);
  EXPECT_EQ(state_.height_m, 0.0);
  EXPECT_GT(surface_.clearance_m, 0.0);
  const Vec3d there_m = over(away_m);
  const contact_detail::TipMotion<double> still{there_m, there_m, 0.0};
  EXPECT_EQ(contact_detail::find_meeting(surface_, state_, still), contact_detail::Meeting::none);
  EXPECT_LE(surface_.clearance_m, dot(there_m - place_m_, state_.normal));
}
INSTANTIATE_TEST_SUITE_P(Height, Return, ::testing::Values(-3e-4, 3e-4));

}  // namespace
}  // namespace palpate
