#include "host/msd/tangent.hpp"

#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "host/msd/forces.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

std::vector<Body> bodies() {
  LatticeSpec solid = test::reference_spec(4, 0.8);
  solid.nodes = {4, 3, 4};
  std::vector<Body> all;
  all.push_back(make_lattice(solid));
  all.push_back(make_lattice(test::planar_spec(5, 0.8)));
  all.push_back(make_lattice(test::layered_spec(test::reference_spec(5))));
  all.push_back(test::irregular_body());
  return all;
}

Eigen::VectorXd free_forces(const Body& body, ForceEvaluator& evaluator, const BodyState& state) {
  Eigen::Matrix3Xd force_N;
  evaluator.evaluate(state, force_N);
  Eigen::VectorXd result(body.dof_count());
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (body.dof(node, axis) >= 0) result[body.dof(node, axis)] = force_N(axis, node);
  return result;
}

TEST(Tangent, IsTheDerivativeOfTheForces) {
  constexpr double kStep = 1e-6;  // m and m/s
  // Central differences; entries are hundreds of N/m and N s/m, of which rounding leaves 1e-16 / 1e-6 x 10 N
  // and truncation step^2 k / length^2.
  constexpr double kTolerance = 1e-5;
  for (const Body& body : bodies()) {
    ForceEvaluator evaluator(body);
    for (unsigned seed = 0; seed < 3; ++seed) {
      BodyState state = test::random_state(body, seed, 0.003, 0.5);
      const Tangent exact = tangent(body, state);
      const Eigen::MatrixXd by_x = exact.df_dx_N_m;
      const Eigen::MatrixXd by_v = exact.df_dv_N_s_m;
      for (int node = 0; node < body.node_count(); ++node) {
        for (const int axis : body.axes()) {
          const int dof = body.dof(node, axis);
          if (dof < 0) continue;
          for (Eigen::Matrix3Xd* varied : {&state.position_m, &state.velocity_m_s}) {
            const double there = (*varied)(axis, node);
            (*varied)(axis, node) = there + kStep;
            const Eigen::VectorXd above = free_forces(body, evaluator, state);
            (*varied)(axis, node) = there - kStep;
            const Eigen::VectorXd below = free_forces(body, evaluator, state);
            (*varied)(axis, node) = there;
            const Eigen::VectorXd column = (varied == &state.position_m ? by_x : by_v).col(dof);
            EXPECT_LT((column - (above - below) / (2 * kStep)).cwiseAbs().maxCoeff(), kTolerance);
          }
        }
      }
    }
  }
}

TEST(Tangent, AtRestIsSymmetricAndDampingProportional) {
  const LatticeSpec spec = test::reference_spec(4, 1.0);
  const Body body = make_lattice(spec);
  const Tangent at_rest = tangent(body, body.rest_state());
  const Eigen::MatrixXd by_x = at_rest.df_dx_N_m;
  const Eigen::MatrixXd by_v = at_rest.df_dv_N_s_m;
  EXPECT_LT((by_x - by_x.transpose()).norm(), 1e-12 * by_x.norm());
  // Positions of centimetres in binary round rest lengths by 1e-16 / 1e-2 of the stiffness.
  EXPECT_LT((by_x * (spec.damping_N_s_m / spec.stiffness_N_m) - by_v).norm(), 1e-12 * by_v.norm());
}

TEST(SubsetTangent, IsTheBlockOfTheWholeTangent) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 9, 0.003, 0.5);
    const Tangent whole = tangent(body, state);
    const Eigen::MatrixXd by_x = whole.df_dx_N_m;
    const Eigen::MatrixXd by_v = whole.df_dv_N_s_m;
    std::vector<int> nodes;
    for (int node = body.node_count() - 1; node >= 0; node -= 2) nodes.push_back(node);
    const SubsetTangent subset = subset_tangent(body, state, nodes);
    ASSERT_GT(subset.mass_kg.size(), 0);
    for (Eigen::Index r = 0; r < subset.mass_kg.size(); ++r) {
      const auto row = static_cast<std::size_t>(r);
      EXPECT_EQ(subset.mass_kg[r], body.mass_kg(subset.node[row]));
      for (Eigen::Index c = 0; c < subset.mass_kg.size(); ++c) {
        const auto column = static_cast<std::size_t>(c);
        const int whole_row = body.dof(subset.node[row], subset.axis[row]);
        const int whole_column = body.dof(subset.node[column], subset.axis[column]);
        EXPECT_NEAR(subset.df_dx_N_m(r, c), by_x(whole_row, whole_column), 1e-11);
        EXPECT_NEAR(subset.df_dv_N_s_m(r, c), by_v(whole_row, whole_column), 1e-13);
      }
    }
  }
}

TEST(SubsetTangent, RefusesNodesThatDoNotExistOrRepeat) {
  const Body body = test::irregular_body();
  EXPECT_THROW(subset_tangent(body, body.rest_state(), {1, 5}), std::invalid_argument);
  EXPECT_THROW(subset_tangent(body, body.rest_state(), {-1}), std::invalid_argument);
  EXPECT_THROW(subset_tangent(body, body.rest_state(), {1, 2, 1}), std::invalid_argument);
}

TEST(Tangent, CoincidentNodesContributeNothing) {
  const Body body = test::irregular_body();
  BodyState state = body.rest_state();
  state.position_m.setZero();
  EXPECT_EQ(tangent(body, state).df_dx_N_m.norm(), 0.0);
}

// K and B of the changes alone, over the body's degrees of freedom.
std::array<Eigen::MatrixXd, 2> assembled(const Body& body, const std::vector<TangentChange>& changes) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(body.dof_count(), body.dof_count()), b = k;
  for (const TangentChange& change : changes)
    for (const int row_node : {change.i, change.j})
      for (const int column_node : {change.i, change.j})
        for (const int row_axis : body.axes())
          for (const int column_axis : body.axes()) {
            const int row = body.dof(row_node, row_axis), column = body.dof(column_node, column_axis);
            if (row < 0 || column < 0) continue;
            const double sign = row_node == column_node ? 1.0 : -1.0;
            k(row, column) += sign * change.stiffness_N_m(row_axis, column_axis);
            b(row, column) += sign * change.damping_N_s_m(row_axis, column_axis);
          }
  return {k, b};
}

TEST(TangentChanges, AddUpToTheDifferenceFromRest) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 4, 0.003, 0.5);
    const Tangent now = tangent(body, state), rest = tangent(body, body.rest_state());
    std::vector<TangentChange> changes;
    TangentChanges(body).find(state, 0.0, changes);
    const auto [k, b] = assembled(body, changes);
    EXPECT_LT((k + Eigen::MatrixXd(now.df_dx_N_m - rest.df_dx_N_m)).norm(), 1e-12 * now.df_dx_N_m.norm());
    EXPECT_LE((b + Eigen::MatrixXd(now.df_dv_N_s_m - rest.df_dv_N_s_m)).norm(),
              1e-12 * now.df_dv_N_s_m.norm());
  }
}

TEST(TangentChanges, AreThoseNearWhatHasMoved) {
  const Body body = make_lattice(test::reference_spec(6));
  const int moved = body.lattice()->node(2, 2, 3);
  BodyState state = body.rest_state();
  state.position_m(2, moved) += 0.002;
  std::vector<TangentChange> changes;
  TangentChanges(body).find(state, 1e-2, changes);
  EXPECT_FALSE(changes.empty());
  EXPECT_LE(changes.size(), body.springs_of(moved).size());
  for (const TangentChange& change : changes) EXPECT_TRUE(change.i == moved || change.j == moved);
  TangentChanges(body).find(body.rest_state(), 0.0, changes);
  EXPECT_TRUE(changes.empty());
}

}  // namespace
}  // namespace palpate::host
