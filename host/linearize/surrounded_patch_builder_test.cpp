#include "host/linearize/surrounded_patch_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "host/linearize/body_response.hpp"
#include "host/linearize/compliance_error.hpp"
#include "host/msd/forces.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kTick_s = 1e-3;
constexpr PatchSize kPatch{4, 4, 2};

class Surrounded : public testing::Test {
 protected:
  [[nodiscard]] LocalModel build(Builder builder, const BodyState& state) const {
    return make_builder(body_, {builder, kPatch, TangentAt::frame, {}}, kTick_s)->build(state, contact_, {});
  }

  Body body_ = make_lattice(test::reference_spec(8));
  BodyState rest_ = body_.rest_state();
  SurfacePoint contact_ = nearest_surface_point(body_, rest_.position_m, {0.031, 0.032, 1.0});
};

TEST_F(Surrounded, AnswerAsTheWholeBodyWhereTheySay) {
  BodyResponse response(body_, rest_, {contact_});
  const std::vector<double> grid_Hz = compliance_grid_Hz();
  std::vector<Eigen::Matrix3cd> exact;
  for (const double hertz : grid_Hz) exact.push_back(response.compliance(2.0 * std::numbers::pi * hertz)[0]);
  const auto error = [&](Builder builder) {
    return compliance_error(build(builder, rest_), contact_, grid_Hz, exact);
  };
  const ComplianceError patch = error(Builder::patch), rescaled = error(Builder::patch_rescaled),
                        condensed = error(Builder::condensed);
  EXPECT_GT(patch.relative[0], 0.1);
  EXPECT_LT(condensed.relative[0], 1e-9);
  EXPECT_LT(rescaled.relative[0], 0.9 * patch.relative[0]);
  EXPECT_LT(condensed.largest, 0.9 * patch.largest);
}

// A force of 5 mN held for 0.4 s, until the body rests: how far the pushed node is from the body's, relative.
TEST_F(Surrounded, SettleWhereTheWholeBodyDoes) {
  constexpr int kTicks = 400, kStepsPerTick = 10;
  const std::vector<Builder> builders{Builder::patch, Builder::patch_rescaled, Builder::condensed};
  std::vector<LocalModel> models;
  for (const Builder builder : builders) models.push_back(build(builder, rest_));
  const int node = models[0].node[5];
  const Eigen::Vector3d force_N(0.003, 0.0, -0.004);
  SemiImplicitEuler integrator(body_);
  BodyState state = rest_;
  const std::array push{NodalForce{node, from_eigen(force_N)}};
  for (int i = 0; i < kTicks * kStepsPerTick; ++i) integrator.step(state, push, kTick_s / kStepsPerTick);
  const Eigen::Vector3d body_m = state.position_m.col(node) - rest_.position_m.col(node);

  std::vector<double> error;
  for (LocalModel& model : models) {
    const auto at = std::find(model.node.begin(), model.node.end(), node) - model.node.begin();
    const Eigen::MatrixXd rows = model.basis.middleRows<3>(3 * at);
    for (int tick = 0; tick < kTicks; ++tick) {
      const Eigen::VectorXd u = model.load + rows.transpose() * force_N;
      for (Eigen::Index m = 0; m < model.modes(); ++m) {
        const ModalCoefficients& c = model.coefficient[static_cast<std::size_t>(m)];
        const double q = model.q[m], p = model.p[m];
        model.q[m] += c.a11 * q + c.a12 * p + c.b1 * u[m];
        model.p[m] += c.a21 * q + c.a22 * p + c.b2 * u[m];
      }
    }
    error.push_back((rows * model.q - body_m).norm() / body_m.norm());
  }
  EXPECT_GT(error[0], 0.1);
  EXPECT_LT(error[1], 0.9 * error[0]);
  EXPECT_LT(error[2], 0.01);  // 0.1 mm in a cell of 1 cm: the body is linear to 1 %
}

TEST_F(Surrounded, StartWithTheAccelerationOfTheNonlinearBody) {
  const BodyState state = test::random_state(body_, 2, 0.001, 0.1);
  for (const Builder builder : {Builder::patch_rescaled, Builder::condensed}) {
    const LocalModel model = build(builder, state);
    const Eigen::VectorXd acceleration =
        model.basis * (model.load - model.damping_rad_s.cwiseProduct(model.p));
    for (std::size_t n = 0; n < model.node.size(); ++n) {
      const Eigen::Vector3d exact = nodal_force_N(body_, state, model.node[n]) / body_.mass_kg(model.node[n]);
      EXPECT_LT((acceleration.segment<3>(3 * static_cast<Eigen::Index>(n)) - exact).norm(),
                1e-10 * exact.norm());
    }
  }
}

TEST_F(Surrounded, RememberWhatIsAround) {
  SurroundedPatchBuilder builder(body_, kPatch, SurroundedBy::condensed, kTick_s);
  const LocalModel first = builder.build(rest_, contact_, {});
  (void)builder.build(rest_, nearest_surface_point(body_, rest_.position_m, {0.05, 0.032, 1.0}), {});
  const LocalModel again = builder.build(rest_, contact_, {});
  EXPECT_EQ(first.lambda_rad2_s2, again.lambda_rad2_s2);
  EXPECT_EQ(first.basis, again.basis);
}

TEST_F(Surrounded, RefuseDrivenNodes) {
  for (const SurroundedBy by : {SurroundedBy::rescaled, SurroundedBy::condensed}) {
    SurroundedPatchBuilder builder(body_, kPatch, by, kTick_s);
    EXPECT_THROW((void)builder.build(rest_, contact_, {400}), std::invalid_argument);
  }
}

}  // namespace
}  // namespace palpate::host
