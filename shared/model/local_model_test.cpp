#include "shared/model/local_model.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "shared/model/test_model.hpp"

namespace palpate {
namespace {

class LocalModelCheck : public ::testing::Test {
 protected:
  test::TestModel model_{1e-3, 50, 1500, 1.0};
};

TEST_F(LocalModelCheck, AcceptsAGoodModel) {
  EXPECT_EQ(check(model_.view, model_.state), Status::ok);
}

TEST_F(LocalModelCheck, RefusesWhatDoesNotFit) {
  auto view = model_.view;
  view.modes = kMaxModes + 1;
  EXPECT_EQ(check(view, model_.state), Status::model_too_large);
  view = model_.view;
  view.nodes = kMaxSurfaceNodes + 1;
  EXPECT_EQ(check(view, model_.state), Status::model_too_large);
  view = model_.view;
  view.triangles = kMaxTriangles + 1;
  EXPECT_EQ(check(view, model_.state), Status::model_too_large);
  view = model_.view;
  view.nodes = 32;
  view.modes = 192;  // each within its bound, the basis is not
  EXPECT_EQ(check(view, model_.state), Status::model_too_large);
}

TEST_F(LocalModelCheck, RefusesEmptyAndBadIndices) {
  auto view = model_.view;
  view.modes = 0;
  EXPECT_EQ(check(view, model_.state), Status::model_inconsistent);
  model_.corner[4] = 4;
  EXPECT_EQ(check(model_.view, model_.state), Status::model_inconsistent);
}

TEST_F(LocalModelCheck, RefusesFrictionThatIsNone) {
  model_.triangle_friction[1] = 1;
  EXPECT_EQ(check(model_.view, model_.state), Status::model_inconsistent);
  model_.triangle_friction[1] = 0;
  for (const auto& [most, kinetic] : {std::pair{0.5f, 0.6f}, std::pair{0.5f, -0.1f}, std::pair{-0.1f, -0.1f},
                                      std::pair{std::numeric_limits<float>::quiet_NaN(), 0.0f},
                                      std::pair{0.5f, std::numeric_limits<float>::quiet_NaN()},
                                      std::pair{std::numeric_limits<float>::infinity(), 0.0f}}) {
    model_.static_friction[0] = most;
    model_.kinetic_friction[0] = kinetic;
    EXPECT_EQ(check(model_.view, model_.state), Status::model_inconsistent) << most << " " << kinetic;
  }
  auto view = model_.view;
  view.frictions = kMaxFrictions + 1;
  EXPECT_EQ(check(view, model_.state), Status::model_too_large);
}

TEST_F(LocalModelCheck, RefusesSpringsThatAreNone) {
  test::TestSprings springs(model_);
  EXPECT_EQ(check(model_.view, model_.state), Status::ok);
  const auto refused = [&](auto& value, auto wrong, Status status) {
    const auto before = value;
    value = wrong;
    EXPECT_EQ(check(model_.view, model_.state), status);
    value = before;
  };
  refused(springs.end[3], std::uint8_t{4}, Status::model_inconsistent);   // no such node
  refused(springs.end[1], springs.end[0], Status::model_inconsistent);    // from a node to itself
  refused(springs.kind[2], std::uint8_t{2}, Status::model_inconsistent);  // no such kind
  refused(springs.stiffness_N_m[1], -1.0f, Status::model_inconsistent);
  refused(springs.damping_N_s_m[0], -1.0f, Status::model_inconsistent);
  refused(springs.length_m[1], -1.0f, Status::model_inconsistent);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  refused(springs.rest_m[4], kNan, Status::model_not_finite);
  refused(springs.stiffness_N_m[1], std::numeric_limits<float>::infinity(), Status::model_not_finite);
  refused(model_.view.springs, kMaxSprings + 1, Status::model_too_large);
  refused(model_.view.spring_kinds, kMaxSpringKinds + 1, Status::model_too_large);
  refused(model_.view.surface_nodes, std::size_t{5}, Status::model_inconsistent);  // more than nodes
  refused(model_.view.surface_nodes, std::size_t{3},
          Status::model_inconsistent);  // a triangle has the fourth
}

TEST_F(LocalModelCheck, RefusesNanAnywhere) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (float* value : {&model_.position_m[5], &model_.coefficient[70], &model_.load[11], &model_.scale[0],
                       &model_.state.q[3], &model_.state.p[11]}) {
    const float before = *value;
    *value = kNan;
    EXPECT_EQ(check(model_.view, model_.state), Status::model_not_finite);
    *value = std::numeric_limits<float>::infinity();
    EXPECT_EQ(check(model_.view, model_.state), Status::model_not_finite);
    *value = before;
  }
}

}  // namespace
}  // namespace palpate
