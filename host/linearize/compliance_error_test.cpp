#include "host/linearize/compliance_error.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <complex>
#include <numbers>
#include <stdexcept>

#include "host/linearize/body_response.hpp"
#include "host/linearize/model_builder.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kTick_s = 1e-3;

double rad_s(double hertz) {
  return 2.0 * std::numbers::pi * hertz;
}

SurfacePoint top_centre(const Body& body) {
  const Eigen::Matrix3Xd& rest_m = body.rest_position_m();
  const Eigen::Vector3d middle_m = 0.5 * (rest_m.rowwise().minCoeff() + rest_m.rowwise().maxCoeff());
  return nearest_surface_point(body, rest_m, middle_m + Eigen::Vector3d(0.001, 0.002, 1.0));
}

// By a dense complex solution, of the matrix as it is.
Eigen::Matrix3cd dense_compliance(const Body& body, const BodyState& state, const SurfacePoint& point,
                                  double w) {
  const Tangent now = tangent(body, state);
  Eigen::MatrixXcd dynamic = -Eigen::MatrixXd(now.df_dx_N_m).cast<std::complex<double>>();
  dynamic -= std::complex<double>(0, w) * Eigen::MatrixXd(now.df_dv_N_s_m);
  Eigen::MatrixXcd force = Eigen::MatrixXcd::Zero(body.dof_count(), 3);
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) dynamic(dof, dof) -= w * w * body.mass_kg(node);
  for (int c = 0; c < 3; ++c) {
    const int node = body.triangles()[static_cast<std::size_t>(point.triangle)][static_cast<std::size_t>(c)];
    for (int axis = 0; axis < 3; ++axis)
      if (const int dof = body.dof(node, axis); dof >= 0) force(dof, axis) += point.barycentric[c];
  }
  return force.transpose() * dynamic.partialPivLu().solve(force);
}

TEST(BodyResponse, IsTheSolutionOfTheLinearBody) {
  // At rest to its 1e-6; about a bent body in motion, whose stiffness is not symmetric, to ten times that.
  LatticeSpec layered = test::layered_spec(test::reference_spec(5));
  for (MaterialRegion& region : layered.regions) region.damping_N_s_m = 0.3;  // not proportional
  for (const LatticeSpec& spec : {test::reference_spec(5), layered}) {
    const Body body = make_lattice(spec);
    const SurfacePoint centre = top_centre(body);
    const SurfacePoint corner{centre.triangle, {0.0, 1.0, 0.0}};
    const BodyState rest = body.rest_state(), bent = test::random_state(body, 4, 0.001, 0.1);
    for (const auto& [state, tolerance] : {std::pair{&rest, 1e-6}, std::pair{&bent, 1e-5}}) {
      BodyResponse response(body, *state, {centre, corner});
      for (const double hertz : {0.0, 0.1, 3.0, 12.0, 15.0, 40.0, 150.0, 500.0}) {
        const auto found = response.compliance(rad_s(hertz));
        for (const auto& [point, which] : {std::pair{centre, 0U}, std::pair{corner, 1U}}) {
          const Eigen::Matrix3cd exact = dense_compliance(body, *state, point, rad_s(hertz));
          EXPECT_LT((found[which] - exact).norm(), tolerance * exact.norm()) << hertz << " Hz";
        }
      }
    }
  }
}

TEST(BodyResponse, RefusesWhatHasNoAnswer) {
  const Body body = make_lattice(test::reference_spec(4));
  EXPECT_THROW(BodyResponse(body, body.rest_state(), {}), std::invalid_argument);
  const Body planar = make_lattice(test::planar_spec(4));
  EXPECT_THROW(BodyResponse(planar, planar.rest_state(), {SurfacePoint{}}), std::invalid_argument);
}

TEST(ComplianceError, OfThePatchThatIsTheWholeBodyIsZero) {
  // 4 x 4 x 4 nodes, bottom fixed: the patch is the body.
  const Body body = make_lattice(test::reference_spec(4));
  const SurfacePoint contact = top_centre(body);
  const LocalModel model = build_patch(body, body.rest_state(), contact, {4, 4, 4}, kTick_s);
  BodyResponse response(body, body.rest_state(), {contact});
  const std::vector<double> grid_Hz = compliance_grid_Hz();
  std::vector<Eigen::Matrix3cd> exact;
  for (const double hertz : grid_Hz) exact.push_back(response.compliance(rad_s(hertz))[0]);
  EXPECT_LT(compliance_error(model, contact, grid_Hz, exact).largest, 2e-6);
}

TEST(ComplianceError, GridIsFineEnough) {
  const Body body = make_lattice(test::reference_spec(6));
  const SurfacePoint contact = top_centre(body);
  const LocalModel model = build_patch(body, body.rest_state(), contact, {4, 4, 2}, kTick_s);
  BodyResponse response(body, body.rest_state(), {contact});
  const auto largest = [&](int per_decade) {
    const std::vector<double> grid_Hz = compliance_grid_Hz(per_decade);
    EXPECT_EQ(grid_Hz.front(), 0.0);
    EXPECT_DOUBLE_EQ(grid_Hz[1], 0.1);
    EXPECT_NEAR(grid_Hz.back(), 500.0, 1e-9);
    std::vector<Eigen::Matrix3cd> exact;
    for (const double hertz : grid_Hz) exact.push_back(response.compliance(rad_s(hertz))[0]);
    const ComplianceError error = compliance_error(model, contact, grid_Hz, exact);
    EXPECT_EQ(error.largest, *std::max_element(error.relative.begin(), error.relative.end()));
    EXPECT_GT(error.largest, 0.1);
    return error.largest;
  };
  const double coarse = largest(40), fine = largest(160);
  EXPECT_LT(fine, 1.02 * coarse);
}

TEST(ComplianceError, RefusesWhatItCannotCompare) {
  const Body body = make_lattice(test::reference_spec(6));
  const SurfacePoint contact = top_centre(body);
  const LocalModel model = build_patch(body, body.rest_state(), contact, {4, 4, 2}, kTick_s);
  const std::vector<double> one_Hz{1.0};
  const std::vector<Eigen::Matrix3cd> none, fixed{Eigen::Matrix3cd::Zero()};
  EXPECT_THROW((void)compliance_error(model, contact, one_Hz, none), std::invalid_argument);
  EXPECT_THROW((void)compliance_error(model, contact, one_Hz, fixed), std::invalid_argument);
  int outside = 0;
  while (std::find(model.triangle.begin(), model.triangle.end(), outside) != model.triangle.end()) ++outside;
  EXPECT_THROW((void)compliance(model, {outside, contact.barycentric}, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
