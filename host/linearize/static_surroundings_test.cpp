#include "host/linearize/static_surroundings.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <stdexcept>

#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

// Of cond(K), some 1e4 here, times rounding, with room.
constexpr double kRounding = 1e-9;

std::vector<int> top_block(const Body& body, int along, int depth) {
  std::vector<int> nodes;
  const LatticeShape& lattice = *body.lattice();
  for (int k = lattice.nodes[2] - depth; k < lattice.nodes[2]; ++k)
    for (int j = 1; j < 1 + along; ++j)
      for (int i = 1; i < 1 + along; ++i) nodes.push_back(lattice.node(i, j, k));
  return nodes;
}

// The block of the body's stiffness for the nodes' degrees of freedom, and the Schur complement with the
// others.
struct Dense {
  Eigen::MatrixXd block, schur;
};
Dense dense(const Body& body, const std::vector<int>& nodes) {
  const Eigen::MatrixXd k = -Eigen::MatrixXd(tangent(body, body.rest_state()).df_dx_N_m);
  std::vector<int> own, other;
  std::vector<bool> is_own(static_cast<std::size_t>(body.dof_count()));
  for (const int node : nodes)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) {
        own.push_back(dof);
        is_own[static_cast<std::size_t>(dof)] = true;
      }
  for (int dof = 0; dof < body.dof_count(); ++dof)
    if (!is_own[static_cast<std::size_t>(dof)]) other.push_back(dof);
  const Eigen::MatrixXd between = k(own, other), others = k(other, other);
  Dense result{k(own, own), {}};
  result.schur = result.block - between * others.llt().solve(between.transpose());
  return result;
}

TEST(StaticSurroundings, AreTheSchurComplement) {
  const Body body = make_lattice(test::layered_spec(test::reference_spec(6)));
  const std::vector<int> nodes = top_block(body, 4, 2);
  const Dense exact = dense(body, nodes);
  const StaticSurroundings around(body);
  EXPECT_LT((around.compliance_m_N(nodes) * exact.schur - Eigen::MatrixXd::Identity(96, 96)).norm(),
            kRounding * 96);
  const Eigen::MatrixXd softening = around.softening_N_m(nodes);
  EXPECT_LT((softening - (exact.block - exact.schur)).norm(), kRounding * exact.block.norm());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(softening);
  EXPECT_GT(solver.eigenvalues()[0], -kRounding * exact.block.norm());
}

TEST(StaticSurroundings, TheFactorMakesTheBorderYieldAsInTheBody) {
  const Body body = make_lattice(test::reference_spec(7));
  const std::vector<int> nodes = top_block(body, 4, 2);
  const StaticSurroundings around(body);
  const double factor = around.spring_factor(nodes);
  EXPECT_GT(factor, 0.1);
  EXPECT_LT(factor, 0.9);
  const Eigen::MatrixXd scaled = -subset_tangent(body, body.rest_state(), nodes, factor).df_dx_N_m;
  const Eigen::MatrixXd held = -subset_tangent(body, body.rest_state(), nodes).df_dx_N_m;
  const Eigen::MatrixXd yields = scaled.inverse(), wanted = around.compliance_m_N(nodes);
  double sum = 0, sum_wanted = 0;
  int at_border = 0;
  for (Eigen::Index d = 0; d < 96; ++d) {
    if ((scaled - held).row(d).isZero(0.0)) continue;
    ++at_border;
    sum += yields(d, d);
    sum_wanted += wanted(d, d);
  }
  EXPECT_EQ(at_border, 3 * (32 - 4));  // all but the four in the middle of the top
  EXPECT_NEAR(sum, sum_wanted, 1e-7 * sum_wanted);
}

TEST(StaticSurroundings, ThereMayBeNone) {
  // Above a fixed face, the whole body: nothing yields that is not in the model.
  const Body body = make_lattice(test::reference_spec(4));
  std::vector<int> all;
  for (int node = 0; node < body.node_count(); ++node) all.push_back(node);
  const StaticSurroundings around(body);
  EXPECT_EQ(around.spring_factor(all), 1.0);
  EXPECT_LT(around.softening_N_m(all).norm(), kRounding * dense(body, all).block.norm());
  // Fixed nodes alone.
  const std::vector<int> fixed{0, 1, 2};
  EXPECT_EQ(around.spring_factor(fixed), 1.0);
  EXPECT_EQ(around.softening_N_m(fixed).size(), 0);
}

TEST(StaticSurroundings, RefuseABodyThatFloats) {
  const Body body = make_lattice(test::free_spec(4, 1.0));
  EXPECT_THROW(StaticSurroundings{body}, std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
