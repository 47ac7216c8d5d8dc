#include "host/msd/implicit_matrix.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <vector>

#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double kStageStep_s = 2e-3;

std::vector<Body> bodies() {
  std::vector<Body> all;
  all.push_back(make_lattice(test::reference_spec(4, 0.8)));
  all.push_back(make_lattice(test::planar_spec(6, 0.8)));
  all.push_back(make_lattice(test::layered_spec(test::reference_spec(6))));
  all.push_back(test::irregular_body());
  return all;
}

// The matrix over the degrees of freedom, column by column.
Eigen::MatrixXd assemble(const Body& body, const ImplicitMatrix& matrix) {
  Eigen::MatrixXd result(body.dof_count(), body.dof_count());
  NodalArray unit = NodalArray::Zero(body.node_count(), 3);
  NodalArray product;
  const auto each_dof = [&](auto action) {
    for (int node = 0; node < body.node_count(); ++node)
      for (const int axis : body.axes())
        if (body.dof(node, axis) >= 0) action(node, axis, body.dof(node, axis));
  };
  each_dof([&](int node, int axis, int column) {
    unit(node, axis) = 1.0;
    matrix.apply(unit, product);
    each_dof([&](int n, int a, int row) { result(row, column) = product(n, a); });
    unit(node, axis) = 0.0;
  });
  return result;
}

Eigen::MatrixXd exact_matrix(const Body& body, const BodyState& state) {
  const Tangent t = tangent(body, state);
  Eigen::MatrixXd result = -kStageStep_s * Eigen::MatrixXd(t.df_dv_N_s_m) -
                           kStageStep_s * kStageStep_s * Eigen::MatrixXd(t.df_dx_N_m);
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (body.dof(node, axis) >= 0) result(body.dof(node, axis), body.dof(node, axis)) += body.mass_kg(node);
  return result;
}

TEST(ImplicitMatrix, IsMassDampingAndStiffnessOfTheTangent) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 1, 0.003, 0.0);
    ImplicitMatrix matrix(body);
    matrix.linearize(state.position_m.transpose(), state.velocity_m_s.transpose(), kStageStep_s, false);
    const Eigen::MatrixXd exact = exact_matrix(body, state);
    EXPECT_LT((assemble(body, matrix) - exact).norm(), 1e-13 * exact.norm());
  }
}

TEST(ImplicitMatrix, LeavesOutOnlyTheAsymmetricPartOfMovingDampers) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 2, 0.002, 0.3);
    ImplicitMatrix matrix(body);
    matrix.linearize(state.position_m.transpose(), state.velocity_m_s.transpose(), kStageStep_s, false);
    const Eigen::MatrixXd mine = assemble(body, matrix);
    const Eigen::MatrixXd exact = exact_matrix(body, state);
    EXPECT_LT((mine - mine.transpose()).norm(), 1e-13 * mine.norm());
    // The part left out is g |u| / length of the damping: 2 ms x 0.3 m/s / 1 cm.
    EXPECT_LT((mine - exact).norm(), 0.06 * exact.norm());
  }
}

TEST(ImplicitMatrix, WithoutCompressionIsPositiveDefinite) {
  for (const Body& body : bodies()) {
    BodyState state = body.rest_state();
    state.position_m *= 0.3;
    ImplicitMatrix matrix(body);
    NodalArray b = NodalArray::Zero(body.node_count(), 3);
    NodalArray x;
    for (int node = 0; node < body.node_count(); ++node)
      if (!body.fixed(node)) b(node, 0) = 1e-3 * (node % 3 - 1);
    constexpr double kLargeStep_s = 0.1;
    matrix.linearize(state.position_m.transpose(), state.velocity_m_s.transpose(), kLargeStep_s, false);
    EXPECT_FALSE(matrix.solve(b, 1e-8, x));  // crushed springs push outwards: no minimum to find
    matrix.linearize(state.position_m.transpose(), state.velocity_m_s.transpose(), kLargeStep_s, true);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(assemble(body, matrix)).eigenvalues().minCoeff(),
              0.0);
    EXPECT_TRUE(matrix.solve(b, 1e-8, x));
  }
}

TEST(ImplicitMatrix, SolveInvertsApply) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 3, 0.001, 0.2);
    ImplicitMatrix matrix(body);
    matrix.linearize(state.position_m.transpose(), state.velocity_m_s.transpose(), kStageStep_s, false);
    const NodalArray expected = test::random_state(body, 4, 0.0, 1.0).velocity_m_s.transpose();
    NodalArray b;
    matrix.apply(expected, b);
    NodalArray x;
    ASSERT_TRUE(matrix.solve(b, 1e-12, x));
    EXPECT_LT((x - expected).norm(), 1e-9 * expected.norm());
  }
}

}  // namespace
}  // namespace palpate::host
