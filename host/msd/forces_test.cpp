#include "host/msd/forces.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "host/msd/energy.hpp"
#include "host/msd/spring_layout.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

// Forces of springs of 100 N/m stretched by millimetres are tenths of newtons; sums of 26 of them round to
// this.
constexpr double kRounding_N = 1e-13;

std::vector<Body> bodies() {
  std::vector<Body> all;
  for (const Neighbours neighbours : {Neighbours::axis, Neighbours::edge, Neighbours::full}) {
    LatticeSpec spec = test::reference_spec(5, 0.7);
    spec.nodes = {5, 4, 7};
    spec.neighbours = neighbours;
    spec.gravity_m_s2 = {0.1, -0.2, -9.81};
    all.push_back(make_lattice(spec));
  }
  all.push_back(make_lattice(test::planar_spec(9, 0.3)));
  all.push_back(make_lattice(test::layered_spec(test::reference_spec(7))));
  all.push_back(make_lattice(test::layered_spec(test::planar_spec(9))));
  all.push_back(make_lattice(test::reference_spec(2)));
  all.push_back(test::irregular_body());
  return all;
}

Eigen::Matrix3Xd forces_of(const Body& body, const BodyState& state) {
  ForceEvaluator evaluator(body);
  Eigen::Matrix3Xd force_N;
  evaluator.evaluate(state, force_N);
  return force_N;
}

TEST(Forces, EqualTheSumOfSingleSprings) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 1, 0.003, 0.5);
    const Eigen::Matrix3Xd force_N = forces_of(body, state);
    for (int node = 0; node < body.node_count(); ++node)
      EXPECT_LT((force_N.col(node) - nodal_force_N(body, state, node)).norm(), kRounding_N);
  }
}

TEST(Forces, AreMinusTheGradientOfTheEnergyWithoutDamping) {
  constexpr double kStep_m = 1e-6;
  // Central differences: rounding of energies of up to 1 J, summed over up to 3,000 springs, 1e-14 J / 1e-6
  // m; truncation kStep^2 k / rest length^2.
  constexpr double kTolerance_N = 1e-7;
  for (const Body& body : bodies()) {
    BodyState state = test::random_state(body, 2, 0.003, 0.0);
    const Eigen::Matrix3Xd force_N = forces_of(body, state);
    for (int node = 0; node < body.node_count(); node += 3) {
      for (int axis = 0; axis < 3; ++axis) {
        const double there_m = state.position_m(axis, node);
        state.position_m(axis, node) = there_m + kStep_m;
        const double above_J = potential_energy_J(body, state);
        state.position_m(axis, node) = there_m - kStep_m;
        const double below_J = potential_energy_J(body, state);
        state.position_m(axis, node) = there_m;
        EXPECT_NEAR(force_N(axis, node), -(above_J - below_J) / (2 * kStep_m), kTolerance_N);
      }
    }
  }
}

TEST(Forces, DampersTakeThePowerTheyDissipate) {
  for (const Body& body : bodies()) {
    const BodyState moving = test::random_state(body, 3, 0.003, 0.5);
    BodyState still = moving;
    still.velocity_m_s.setZero();
    const Eigen::Matrix3Xd damping_N = forces_of(body, moving) - forces_of(body, still);
    const double power_W = damping_N.cwiseProduct(moving.velocity_m_s).sum();
    EXPECT_GT(dissipated_power_W(body, moving), 0.0);
    EXPECT_NEAR(power_W, -dissipated_power_W(body, moving), 1e-12 * dissipated_power_W(body, moving) + 1e-13);
  }
}

TEST(Forces, SumToTheWeightAndTurnNothing) {
  for (const Body& body : bodies()) {
    const BodyState state = test::random_state(body, 4, 0.003, 0.5);
    Eigen::Matrix3Xd force_N = forces_of(body, state);
    for (int node = 0; node < body.node_count(); ++node)
      force_N.col(node) -= body.mass_kg(node) * to_eigen(body.gravity_m_s2());
    EXPECT_LT(force_N.rowwise().sum().norm(), 10 * kRounding_N);
    Eigen::Vector3d torque_N_m = Eigen::Vector3d::Zero();
    for (int node = 0; node < body.node_count(); ++node)
      torque_N_m += Eigen::Vector3d(state.position_m.col(node)).cross(Eigen::Vector3d(force_N.col(node)));
    EXPECT_LT(torque_N_m.norm(), kRounding_N);
  }
}

TEST(Forces, PlanarBodiesStayInTheirPlane) {
  const Body body = make_lattice(test::planar_spec(9));
  const BodyState state = test::random_state(body, 5, 0.003, 0.5);
  EXPECT_EQ(forces_of(body, state).row(1).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Forces, CoincidentNodesExertNothingOnEachOther) {
  for (const Body& body : bodies()) {
    BodyState state = test::random_state(body, 6, 0.001, 0.5);
    const Spring& spring = body.springs().front();
    state.position_m.col(spring.i) = state.position_m.col(spring.j);
    const Eigen::Matrix3Xd force_N = forces_of(body, state);
    EXPECT_TRUE(force_N.allFinite());
    EXPECT_LT((force_N.col(spring.i) - nodal_force_N(body, state, spring.i)).norm(), kRounding_N);
    state.position_m.setZero();
    const Eigen::Matrix3Xd collapsed_N = forces_of(body, state);
    for (int node = 0; node < body.node_count(); ++node)
      EXPECT_EQ(collapsed_N.col(node), body.mass_kg(node) * to_eigen(body.gravity_m_s2()));
  }
}

TEST(SpringLayout, HoldsEverySpringOnce) {
  for (const Body& body : bodies()) {
    const SpringLayout layout = make_spring_layout(body);
    std::size_t count = layout.loose.size();
    for (const SpringBand& band : layout.bands)
      for (const double present : band.present) count += present == 1.0 ? 1U : 0U;
    EXPECT_EQ(count, body.springs().size());
  }
}

TEST(SpringLayout, PutsALatticeIntoBands) {
  const SpringLayout layout = make_spring_layout(make_lattice(test::reference_spec(12)));
  EXPECT_EQ(layout.bands.size(), 13U);
  EXPECT_TRUE(layout.loose.empty());
}

// 13 directions in the body, 4 in the plane of the skin, 13 in the core: each a band where it is long enough.
TEST(SpringLayout, BandsHoldOneMaterialEach) {
  const Body body = make_lattice(test::layered_spec(test::reference_spec(12)));
  const SpringLayout layout = make_spring_layout(body);
  std::map<double, std::size_t> bands;
  for (const SpringBand& band : layout.bands) ++bands[band.constants.stiffness_N_m];
  EXPECT_EQ(bands[7.0], 13U);
  EXPECT_GE(bands.size(), 2U);
  for (const SpringBand& band : layout.bands)
    for (std::size_t place = 0; place < band.present.size(); ++place) {
      if (band.present[place] == 0.0) continue;
      const int i = static_cast<int>(band.first) + static_cast<int>(place);
      const int j = i + static_cast<int>(band.offset);
      const auto springs = body.springs_of(i);
      EXPECT_EQ(std::count_if(springs.begin(), springs.end(),
                              [&](int s) {
                                const Spring& spring = body.springs()[static_cast<std::size_t>(s)];
                                return spring.i + spring.j == i + j &&
                                       spring.stiffness_N_m == band.constants.stiffness_N_m &&
                                       spring.damping_N_s_m == band.constants.damping_N_s_m;
                              }),
                1);
    }
}

TEST(SpringLayout, ParallelSpringsKeepTheirStrength) {
  BodyDescription description;
  const int nodes = 40;
  description.mass_kg.assign(nodes, 0.001);
  description.fixed.assign(nodes, false);
  description.rest_position_m = Eigen::Matrix3Xd::Zero(3, nodes);
  for (int n = 0; n < nodes; ++n) description.rest_position_m(0, n) = 0.01 * n;
  for (int n = 0; n + 1 < nodes; ++n) description.springs.push_back({n, n + 1, 100.0, 0.1, 0.009});
  const Body single(description);
  description.springs.insert(description.springs.end(), description.springs.begin(),
                             description.springs.end());
  const Body twice(description);
  const Eigen::Matrix3Xd force_N = forces_of(single, single.rest_state());
  EXPECT_NEAR(force_N(0, 0), 0.1, kRounding_N);  // 1 mm at 100 N/m, towards the neighbour
  EXPECT_LT((forces_of(twice, twice.rest_state()) - 2.0 * force_N).norm(), kRounding_N);
}

}  // namespace
}  // namespace palpate::host
