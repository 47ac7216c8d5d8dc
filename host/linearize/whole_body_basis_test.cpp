#include "host/linearize/whole_body_basis.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "host/msd/tangent.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double k20Hz_rad_s = 2.0 * std::numbers::pi * 20.0;
// Of cond(K), some 1e4 here, times rounding, with room.
constexpr double kRounding = 1e-9;

struct Dense {
  Eigen::MatrixXd stiffness, damping, mass;
};

Dense dense(const Body& body) {
  const Tangent at_rest = tangent(body, body.rest_state());
  Eigen::VectorXd mass(body.dof_count());
  for (int node = 0; node < body.node_count(); ++node)
    for (const int axis : body.axes())
      if (const int dof = body.dof(node, axis); dof >= 0) mass[dof] = body.mass_kg(node);
  return {-Eigen::MatrixXd(at_rest.df_dx_N_m), -Eigen::MatrixXd(at_rest.df_dv_N_s_m), mass.asDiagonal()};
}

// Displacements of the nodes' own degrees of freedom under unit forces there, at a real or complex frequency.
template <class Scalar>
Eigen::Matrix<Scalar, -1, -1> compliance(const Dense& body, Scalar s, const std::vector<int>& dofs) {
  const Eigen::Matrix<Scalar, -1, -1> dynamic =
      body.stiffness.cast<Scalar>() + s * body.damping.cast<Scalar>() + s * s * body.mass.cast<Scalar>();
  Eigen::Matrix<Scalar, -1, -1> forces =
      Eigen::Matrix<Scalar, -1, -1>::Zero(dynamic.rows(), std::ssize(dofs));
  for (std::size_t i = 0; i < dofs.size(); ++i) forces(dofs[i], static_cast<Eigen::Index>(i)) = 1.0;
  const Eigen::Matrix<Scalar, -1, -1> answer = dynamic.partialPivLu().solve(forces);
  return answer(dofs, Eigen::all);
}

template <class Scalar>
Eigen::Matrix<Scalar, -1, -1> compliance(const WholeBodyBasis& basis, Scalar s,
                                         const std::vector<int>& dofs) {
  const Eigen::MatrixXd phi = basis.basis_1_sqrt_kg(dofs, Eigen::all);
  const auto denominator = (basis.lambda_rad2_s2.cast<Scalar>().array() +
                            s * basis.damping_1_s.diagonal().cast<Scalar>().array() + s * s);
  return phi.cast<Scalar>() * denominator.inverse().matrix().asDiagonal() * phi.transpose().cast<Scalar>();
}

std::vector<int> dofs_of(const Body& body, const std::vector<int>& nodes) {
  std::vector<int> dofs;
  for (const int node : nodes)
    for (const int axis : body.axes()) dofs.push_back(body.dof(node, axis));
  return dofs;
}

Body cube(int nodes_per_side) {
  return make_lattice(test::reference_spec(nodes_per_side));
}

class WholeBody : public testing::Test {
 protected:
  Body body_ = cube(6);
  std::vector<int> nodes_{body_.lattice()->node(2, 2, 5), body_.lattice()->node(3, 2, 5),
                          body_.lattice()->node(2, 3, 5), body_.lattice()->node(3, 3, 5)};
  std::vector<int> dofs_ = dofs_of(body_, nodes_);
};

TEST_F(WholeBody, ModesAreOrthonormalAndDiagonal) {
  const Dense full = dense(body_);
  const WholeBodyBasis basis = WholeBodyReduction(body_, {0.0, k20Hz_rad_s}).reduce(nodes_);
  const Eigen::MatrixXd& phi = basis.basis_1_sqrt_kg;
  ASSERT_EQ(phi.rows(), body_.dof_count());
  EXPECT_EQ(phi.cols(), 24);
  const auto modes = phi.cols();
  EXPECT_LT((phi.transpose() * full.mass * phi - Eigen::MatrixXd::Identity(modes, modes)).norm(), kRounding);
  const Eigen::MatrixXd lambda = basis.lambda_rad2_s2.asDiagonal();
  EXPECT_LT((phi.transpose() * full.stiffness * phi - lambda).norm(), kRounding * lambda.norm());
  const Eigen::MatrixXd damping = phi.transpose() * full.damping * phi;
  EXPECT_LT((damping - basis.damping_1_s).norm(), kRounding * damping.norm());
  // One material: proportional, so diagonal.
  const Eigen::MatrixXd diagonal = damping.diagonal().asDiagonal();
  EXPECT_LT((damping - diagonal).norm(), kRounding * damping.norm());
}

TEST_F(WholeBody, AnswersExactlyAtItsOwnFrequencies) {
  const Dense full = dense(body_);
  const WholeBodyBasis basis = WholeBodyReduction(body_, {0.0, k20Hz_rad_s}).reduce(nodes_);
  for (const double s : {0.0, k20Hz_rad_s}) {
    const Eigen::MatrixXd exact = compliance(full, s, dofs_);
    EXPECT_LT((compliance(basis, s, dofs_) - exact).norm(), kRounding * exact.norm())
        << "at " << s << " rad/s";
  }
}

TEST_F(WholeBody, MoreFrequenciesAnswerBetter) {
  std::vector<std::complex<double>> s;
  std::vector<Eigen::MatrixXcd> exact;
  const Dense full = dense(body_);
  for (const double hertz : {0.1, 3.0, 7.0, 10.0, 15.0, 25.0, 60.0, 150.0, 500.0}) {
    s.emplace_back(0.0, 2.0 * std::numbers::pi * hertz);
    exact.push_back(compliance(full, s.back(), dofs_));
  }
  const auto error = [&](const std::vector<double>& shifts) {
    const WholeBodyBasis basis = WholeBodyReduction(body_, shifts).reduce(nodes_);
    double largest = 0;
    for (std::size_t i = 0; i < s.size(); ++i)
      largest = std::max(largest, (compliance(basis, s[i], dofs_) - exact[i]).norm() / exact[i].norm());
    return largest;
  };
  const double one = error({0.0}), two = error({0.0, k20Hz_rad_s}),
               three = error({0.0, k20Hz_rad_s, 7.5 * k20Hz_rad_s});
  EXPECT_LT(two, 0.3 * one);
  EXPECT_LT(three, 0.5 * two);
}

TEST_F(WholeBody, FrequenciesOfTheMiddleAnswerExactlyForItsNodes) {
  const Dense full = dense(body_);
  const LatticeShape& lattice = *body_.lattice();
  std::vector<int> nodes = nodes_;
  for (const auto& [i, j] : {std::pair{1, 1}, std::pair{4, 4}}) nodes.push_back(lattice.node(i, j, 5));
  const WholeBodyBasis basis = WholeBodyReduction(body_, Shifts({0.0}, {k20Hz_rad_s})).reduce(nodes);
  EXPECT_EQ(basis.basis_1_sqrt_kg.cols(), Shifts({0.0}, {k20Hz_rad_s}).most_modes(6));
  const Eigen::MatrixXd still = compliance(full, 0.0, dofs_of(body_, nodes));
  EXPECT_LT((compliance(basis, 0.0, dofs_of(body_, nodes)) - still).norm(), kRounding * still.norm());
  const Eigen::MatrixXd exact = compliance(full, k20Hz_rad_s, dofs_);
  EXPECT_LT((compliance(basis, k20Hz_rad_s, dofs_) - exact).norm(), kRounding * exact.norm());
  const std::vector<int> outer = dofs_of(body_, {nodes[5]});
  const Eigen::MatrixXd there = compliance(full, k20Hz_rad_s, outer);
  EXPECT_GT((compliance(basis, k20Hz_rad_s, outer) - there).norm(), 1e-4 * there.norm());
}

TEST_F(WholeBody, NodesThatSayTheSameAreDropped) {
  // The whole body as ports: there are no more modes than degrees of freedom.
  const Body small = cube(3);
  std::vector<int> all;
  for (int node = 0; node < small.node_count(); ++node) all.push_back(node);
  const WholeBodyBasis basis = WholeBodyReduction(small, {0.0, k20Hz_rad_s}).reduce(all);
  EXPECT_EQ(basis.basis_1_sqrt_kg.cols(), small.dof_count());
}

TEST_F(WholeBody, FixedNodesHaveNoModes) {
  const WholeBodyBasis basis = WholeBodyReduction(body_, {0.0}).reduce({body_.lattice()->node(2, 2, 0)});
  EXPECT_EQ(basis.basis_1_sqrt_kg.cols(), 0);
  EXPECT_EQ(basis.basis_1_sqrt_kg.rows(), body_.dof_count());
}

TEST_F(WholeBody, RefusesWhatHasNoAnswer) {
  EXPECT_THROW(WholeBodyReduction(body_, {}), std::invalid_argument);
  EXPECT_THROW(WholeBodyReduction(body_, {-1.0}), std::invalid_argument);
  EXPECT_THROW(WholeBodyReduction(body_, {20.0, 20.0}), std::invalid_argument);
  EXPECT_THROW(WholeBodyReduction(body_, Shifts({0.0}, {30.0, 20.0})), std::invalid_argument);
  EXPECT_THROW(WholeBodyReduction(body_, {std::nan("")}), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
