#include "host/session/model_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "host/linearize/patch_builder.hpp"
#include "host/session/test_contact.hpp"
#include "shared/model/local_model.hpp"

namespace palpate::host {
namespace {

using test::block;
using test::message_of;

// Rounding to single precision, relative: half of 2^-23.
constexpr double kSingle = 6.0e-8;

class ModelMessageTest : public ::testing::Test {
 protected:
  ModelMessageTest() {
    contact_.mode = ContactMode::slip;
    contact_.triangle = 300;
    contact_.barycentric = {0.2, 0.3, 0.5};
    contact_.force_N = {0.1, -0.2, -0.7};
    contact_.inset_m = 0.003;
    contact_.height_m = -2e-4;
    contact_.overhang_m = {0.001, 0.002, -0.004};
  }
  void pack() { pack_model(model_, stamp_, law_, SurfaceKind::flat, friction_, contact_, *message_); }
  std::string refusal() {
    return message_of<std::invalid_argument>([&] { pack(); });
  }

  Body body_ = block(5);
  BodyState state_ = test::random_state(body_, 1, 5e-4, 0.02);
  LocalModel model_ = build_patch(
      body_, state_, nearest_surface_point(body_, state_.position_m, {0.0175, 0.0215, 0.0}), {}, kTick_s);
  ModelStamp stamp_{7, 1234, 200};
  ContactLaw<double> law_{.tip_radius_m = 0.002};
  // Another friction where x is at most 1.75 cm: a part of the patch.
  SurfaceFriction friction_{
      body_, {.elsewhere = {0.8, 0.6}, .regions = {{{-1.0, -1.0, -1.0}, {0.0175, 1.0, 1.0}, {1.2, 0.3}}}}};
  ContactState<double> contact_{};
  std::unique_ptr<wire::ModelContents> message_ = std::make_unique<wire::ModelContents>();
};

TEST_F(ModelMessageTest, CarriesTheModelInSinglePrecision) {
  pack();
  const wire::ModelContents& m = *message_;
  EXPECT_EQ(m.sequence, 7u);
  EXPECT_EQ(m.tick, 1234u);
  EXPECT_EQ(m.valid_ticks, 200u);
  EXPECT_EQ(m.schema_hash, wire::kSchemaHash);
  ASSERT_EQ(m.static_friction.count, 2u);
  ASSERT_EQ(m.kinetic_friction.count, 2u);
  EXPECT_EQ(m.static_friction.elements[0], 0.8f);
  EXPECT_EQ(m.kinetic_friction.elements[0], 0.6f);
  EXPECT_EQ(m.static_friction.elements[1], 1.2f);
  EXPECT_EQ(m.kinetic_friction.elements[1], 0.3f);
  EXPECT_EQ(m.tip_radius_m, 0.002f);
  EXPECT_EQ(m.surface, static_cast<std::uint8_t>(SurfaceKind::flat));
  EXPECT_EQ(m.contact.mode, static_cast<std::uint8_t>(ContactMode::slip));
  EXPECT_EQ(m.contact.triangle, 300u);
  EXPECT_EQ(m.contact.barycentric[2], 0.5f);
  EXPECT_EQ(m.contact.force_N[1], -0.2f);
  EXPECT_EQ(m.contact.inset_m, 0.003f);
  EXPECT_EQ(m.contact.height_m, -2e-4f);
  EXPECT_EQ(m.contact.overhang_m[2], -0.004f);

  const auto modes = static_cast<std::size_t>(model_.modes());
  ASSERT_EQ(m.modes, modes);
  ASSERT_EQ(m.nodes, model_.node.size());
  ASSERT_EQ(m.triangles, model_.triangle.size());
  const auto same = [](float got, double expected) {
    EXPECT_NEAR(static_cast<double>(got), expected, kSingle * std::abs(expected));
  };
  for (Eigen::Index n = 0; n < model_.position_m.cols(); ++n)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      same(m.position_m.elements[3 * n + axis], model_.position_m(axis, n));
  bool frictions_seen[2] = {};
  ASSERT_EQ(m.triangle_friction.count, m.triangles);
  for (std::size_t t = 0; t < m.triangles; ++t) {
    EXPECT_EQ(m.triangle_id.elements[t], model_.triangle[t]);
    frictions_seen[m.triangle_friction.elements[t]] = true;
    EXPECT_EQ(m.triangle_friction.elements[t],
              friction_.index(static_cast<std::uint32_t>(model_.triangle[t])));
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(m.corner.elements[3 * t + c], model_.corner[t][c]);
  }
  EXPECT_TRUE(frictions_seen[0] && frictions_seen[1]);
  for (std::size_t i = 0; i < modes; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    same(m.coefficient.elements[6 * i], model_.coefficient[i].a11);
    same(m.coefficient.elements[6 * i + 1], model_.coefficient[i].a12);
    same(m.coefficient.elements[6 * i + 2], model_.coefficient[i].a21);
    same(m.coefficient.elements[6 * i + 3], model_.coefficient[i].a22);
    same(m.coefficient.elements[6 * i + 4], model_.coefficient[i].b1);
    same(m.coefficient.elements[6 * i + 5], model_.coefficient[i].b2);
    same(m.load.elements[i], model_.load(column));
    same(m.state_q.elements[i], model_.q(column));
    same(m.state_p.elements[i], model_.p(column));
  }
}

TEST_F(ModelMessageTest, TheBasisIsOffByHalfAStepAtMost) {
  pack();
  // Half a step of 1 / 32767 of the mode's largest entry, and the scale's own rounding.
  constexpr double kHalfStep = 0.5 / 32767.0 + kSingle;
  double largest_error = 0.0;
  for (Eigen::Index m = 0; m < model_.modes(); ++m) {
    const double largest = model_.basis.col(m).cwiseAbs().maxCoeff();
    for (Eigen::Index row = 0; row < model_.basis.rows(); ++row) {
      const double got = static_cast<double>(message_->basis.elements[row * model_.modes() + m]) *
                         static_cast<double>(message_->basis_scale.elements[m]);
      largest_error = std::max(largest_error, std::abs(got - model_.basis(row, m)) / largest);
    }
  }
  EXPECT_LE(largest_error, kHalfStep);
  EXPECT_GE(largest_error, 0.1 * kHalfStep);  // it is quantized
}

TEST_F(ModelMessageTest, WithoutContactThereIsNoContactPoint) {
  contact_.mode = ContactMode::free;
  contact_.triangle = 70000;  // what an old contact left behind
  contact_.barycentric = {std::numeric_limits<double>::quiet_NaN(), 0, 0};
  pack();
  EXPECT_EQ(message_->contact.triangle, 0u);
  EXPECT_EQ(message_->contact.barycentric[0], 0.0f);
}

TEST_F(ModelMessageTest, RefusesWhatTheWireCannotCarry) {
  LocalModel good = model_;
  model_.triangle[0] = 65536;
  EXPECT_EQ(refusal(), "local model: number of a triangle = 65536: must be at most 65535");
  model_ = good;
  model_.triangle.resize(kMaxTriangles + 1);
  EXPECT_EQ(refusal(), "local model: triangles = 97: must be at most 96");
  model_ = good;
  model_.node.resize(kMaxSurfaceNodes + 1);
  EXPECT_EQ(refusal(), "local model: nodes = 33: must be at most 32");
  model_ = good;
  model_.q.resize(kMaxModes + 1);
  EXPECT_EQ(refusal(), "local model: modes = 193: must be at most 192");
  model_ = good;
  model_.node.resize(32);
  model_.q.resize(97);
  EXPECT_EQ(refusal(), "local model: entries of the basis = 9312: must be at most 9216");
  model_ = good;
  EXPECT_EQ(refusal(), "");
}

TEST_F(ModelMessageTest, RefusesNumbersThatSinglePrecisionCannotHold) {
  const LocalModel good = model_;
  for (const double bad :
       {1e39, -1e39, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    std::vector<double*> fields;
    model_ = good;
    for (double* field : {&model_.origin_m.y(), &model_.position_m(2, 1), &model_.coefficient[2].b1,
                          &model_.load(0), &model_.q(1), &model_.p(2)}) {
      const double before = *field;
      *field = bad;
      EXPECT_NE(refusal().find("does not fit in single precision"), std::string::npos) << bad;
      *field = before;
    }
    EXPECT_EQ(refusal(), "");
  }
}

TEST_F(ModelMessageTest, RefusesABasisThatIsNoNumber) {
  for (const double bad :
       {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    LocalModel good = model_;
    for (const Eigen::Index row : {Eigen::Index{0}, Eigen::Index{7}}) {
      model_.basis(row, 3) = bad;
      EXPECT_NE(refusal().find("does not fit in single precision"), std::string::npos)
          << bad << " in row " << row;
      model_ = good;
    }
  }
}

}  // namespace
}  // namespace palpate::host
