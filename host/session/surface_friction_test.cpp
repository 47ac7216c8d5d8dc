#include "host/session/surface_friction.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "host/session/test_contact.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::message_of;
using test::Path;
using test::Touched;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const Vec3d kAllFrom{-1.0, -1.0, -1.0}, kAllTo{1.0, 1.0, 1.0};

TEST(SurfaceFriction, TheLastBoxThatHoldsTheCentroidCounts) {
  const Body body = block(5);
  const FrictionSpec spec{.elsewhere = {0.5, 0.4},
                          .regions = {{{0.01, -1.0, -1.0}, {1.0, 1.0, 1.0}, {0.9, 0.8}},
                                      {{0.02, -1.0, -1.0}, {1.0, 1.0, 1.0}, {0.1, 0.0}},
                                      {{0.03, -1.0, -1.0}, {1.0, 1.0, 1.0}, {0.5, 0.4}}}};
  const SurfaceFriction friction(body, spec);
  ASSERT_EQ(friction.different().size(), 3u);
  bool seen[3] = {};
  for (std::uint32_t t = 0; t < body.triangles().size(); ++t) {
    const Triangle& corner = body.triangles()[t];
    double x_m = 0.0;
    for (const int node : corner) x_m += body.rest_position_m()(0, node) / 3.0;
    const Friction<double> expected = x_m < 0.01 || x_m >= 0.03 ? Friction<double>{0.5, 0.4}
                                      : x_m < 0.02              ? Friction<double>{0.9, 0.8}
                                                                : Friction<double>{0.1, 0.0};
    EXPECT_EQ(friction.of(t), expected) << x_m;
    EXPECT_EQ(friction.different()[friction.index(t)], expected);
    seen[friction.index(t)] = true;
  }
  EXPECT_TRUE(seen[0] && seen[1] && seen[2]);
}

TEST(SurfaceFriction, RefusesWhatHasNoMeaning) {
  const Body body = block(3);
  const auto refusal = [&](const FrictionSpec& spec) {
    return message_of<std::invalid_argument>([&] { SurfaceFriction(body, spec); });
  };
  EXPECT_NE(refusal({{0.5, 0.6}, {}}).find("contact: static friction 0.5"), std::string::npos);
  EXPECT_NE(refusal({{0.5, -0.1}, {}}).find("kinetic friction -0.1"), std::string::npos);
  EXPECT_NE(refusal({{kInfinity, 0.1}, {}}).find("inf"), std::string::npos);
  EXPECT_NE(refusal({{0.5, 0.5}, {{kAllFrom, kAllTo, {0.1, 0.2}}}}).find("contact.regions[0]"),
            std::string::npos);
  EXPECT_NE(refusal({{0.5, 0.5}, {{kAllTo, kAllFrom, {0.2, 0.1}}}}).find("from_m[0] = 1"), std::string::npos);
  FrictionSpec many{{0.5, 0.5}, {}};
  for (const double mu : {0.1, 0.2, 0.3}) many.regions.push_back({kAllFrom, kAllTo, {mu, mu}});
  EXPECT_EQ(SurfaceFriction(body, many).different().size(), 4u);
  many.regions.push_back({kAllFrom, kAllTo, {0.4, 0.4}});
  EXPECT_NE(refusal(many).find("must be at most 4"), std::string::npos);
}

// Dragged from a rough into a slippery half: each step has the friction of the triangle on which it began.
TEST(SurfaceFriction, SlidingIntoARegionChangesTheCone) {
  const Body body = block(5);
  constexpr double kRough = 0.8, kSlippery = 0.2, kBorder_m = 0.02;
  Touched touched(body, {.elsewhere = {kRough, kRough},
                         .regions = {{{kBorder_m, -1.0, -1.0}, kAllTo, {kSlippery, kSlippery}}}});
  Path path({0.0115, 0.0215, 2e-3});
  path.to({0.0115, 0.0215, -2e-3}, 100).to({0.0325, 0.0235, -2e-3}, 400);
  int slips_rough = 0, slips_slippery = 0, changes = 0;
  touched.follow(path, [&](const ContactState<double>& before, const ContactState<double>& after) {
    if (before.mode == ContactMode::free || after.mode != ContactMode::slip) return;
    double x_m = 0.0;
    for (const int node : body.triangles()[before.triangle]) x_m += body.rest_position_m()(0, node) / 3.0;
    const double mu = x_m < kBorder_m ? kRough : kSlippery;
    const Vec3d normal = after.normal;
    const double pressing_N = -dot(after.force_N, normal);
    // Rounding of a 3x3 solve, relative.
    constexpr double kRounding = 1e-9;
    ASSERT_NEAR(norm(after.force_N + normal * pressing_N), mu * pressing_N, kRounding * pressing_N);
    (x_m < kBorder_m ? slips_rough : slips_slippery) += 1;
    changes += touched.surface.friction(before.triangle) != touched.surface.friction(after.triangle);
  });
  EXPECT_GT(slips_rough, 100);
  EXPECT_GT(slips_slippery, 100);
  EXPECT_GE(changes, 1);
}

}  // namespace
}  // namespace palpate::host
