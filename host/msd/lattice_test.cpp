#include "host/msd/lattice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

using test::message_of;
using test::planar_spec;
using test::reference_spec;

std::string refusal(const LatticeSpec& spec) {
  return message_of<std::invalid_argument>([&] { const Body body = make_lattice(spec); });
}

TEST(Lattice, ReferenceBodyHasTheKnownNumberOfSprings) {
  EXPECT_EQ(make_lattice(reference_spec(12)).springs().size(), 18788U);
}

TEST(Lattice, InteriorNodesHaveTheNeighboursAskedFor) {
  const auto count = [](LatticeSpec spec, Neighbours neighbours) {
    spec.neighbours = neighbours;
    const Body body = make_lattice(spec);
    return body.springs_of(body.lattice()->node(2, spec.dimension == 2 ? 0 : 2, 2)).size();
  };
  EXPECT_EQ(count(reference_spec(5), Neighbours::axis), 6U);
  EXPECT_EQ(count(reference_spec(5), Neighbours::edge), 18U);
  EXPECT_EQ(count(reference_spec(5), Neighbours::full), 26U);
  EXPECT_EQ(count(planar_spec(5), Neighbours::axis), 4U);
  EXPECT_EQ(count(planar_spec(5), Neighbours::edge), 8U);
  EXPECT_EQ(count(planar_spec(5), Neighbours::full), 8U);
}

TEST(Lattice, SpringsAreUniqueAndUnstretchedAtRest) {
  for (LatticeSpec spec : {reference_spec(2), reference_spec(5), planar_spec(6)}) {
    spec.origin_m = {0.1, -0.2, 0.3};
    const Body body = make_lattice(spec);
    std::set<std::pair<int, int>> pairs;
    for (const Spring& spring : body.springs()) {
      EXPECT_TRUE(pairs.insert(std::minmax(spring.i, spring.j)).second);
      const double length_m =
          (body.rest_position_m().col(spring.j) - body.rest_position_m().col(spring.i)).norm();
      EXPECT_NEAR(length_m, spring.rest_length_m, 1e-15);  // rounding of positions near 0.3 m
      EXPECT_LT(length_m, 1.8 * spec.spacing_m);
    }
  }
}

// Table 1 of the paper lists these orders; they are those of one fixed edge (2D) or two adjacent fixed faces
// (3D) with the contact node driven: position and velocity of every degree of freedom left.
TEST(Lattice, StateCountsAreThePapers) {
  const auto states = [](const LatticeSpec& spec) {
    const Body body = make_lattice(spec);
    return 2 * (body.dof_count() - static_cast<int>(body.axes().size()));
  };
  const std::array<std::pair<int, int>, 6> planar{
      {{5, 76}, {10, 356}, {12, 524}, {15, 836}, {20, 1516}, {25, 2396}}};
  for (const auto& [n, expected] : planar) EXPECT_EQ(states(planar_spec(n)), expected) << n;
  const std::array<std::pair<int, int>, 4> solid{{{4, 210}, {5, 474}, {6, 894}, {7, 1506}}};
  for (const auto& [n, expected] : solid) {
    LatticeSpec spec = reference_spec(n);
    spec.fixed_faces = {Face::z_minus, Face::x_minus};
    EXPECT_EQ(states(spec), expected) << n;
  }
}

TEST(Lattice, FixesTheFacesAndNodesNamed) {
  LatticeSpec spec = reference_spec(4);
  spec.nodes = {4, 5, 6};
  spec.fixed_faces = {Face::x_plus, Face::y_minus};
  spec.fixed_nodes = {{1, 2, 3}};
  const Body body = make_lattice(spec);
  for (int node = 0; node < body.node_count(); ++node) {
    const auto [i, j, k] = body.lattice()->coordinates(node);
    EXPECT_EQ(body.lattice()->node(i, j, k), node);
    EXPECT_EQ(body.fixed(node), i == 3 || j == 0 || (i == 1 && j == 2 && k == 3));
  }
}

// Node masses and spring constants against the rule, read from the last region to the first.
TEST(Lattice, TheLastRegionThatHoldsThemGivesNodesAndSpringsTheirMaterial) {
  for (const LatticeSpec& plain : {reference_spec(6), planar_spec(7)}) {
    const LatticeSpec spec = test::layered_spec(plain);
    const auto inside = [](const MaterialRegion& region, const std::array<int, 3>& ijk) {
      return ijk[0] >= region.from_node[0] && ijk[0] <= region.to_node[0] && ijk[1] >= region.from_node[1] &&
             ijk[1] <= region.to_node[1] && ijk[2] >= region.from_node[2] && ijk[2] <= region.to_node[2];
    };
    const Body body = make_lattice(spec);
    std::set<double> masses_kg, stiffnesses_N_m;
    for (int node = 0; node < body.node_count(); ++node) {
      const auto ijk = body.lattice()->coordinates(node);
      const auto region = std::find_if(spec.regions.rbegin(), spec.regions.rend(),
                                       [&](const auto& r) { return inside(r, ijk); });
      EXPECT_EQ(body.mass_kg(node), region == spec.regions.rend() ? spec.mass_kg : region->mass_kg);
      masses_kg.insert(body.mass_kg(node));
    }
    for (const Spring& spring : body.springs()) {
      const auto i = body.lattice()->coordinates(spring.i), j = body.lattice()->coordinates(spring.j);
      const auto region = std::find_if(spec.regions.rbegin(), spec.regions.rend(),
                                       [&](const auto& r) { return inside(r, i) && inside(r, j); });
      const bool plain_one = region == spec.regions.rend();
      EXPECT_EQ(spring.stiffness_N_m, plain_one ? spec.stiffness_N_m : region->stiffness_N_m);
      EXPECT_EQ(spring.damping_N_s_m, plain_one ? spec.damping_N_s_m : region->damping_N_s_m);
      stiffnesses_N_m.insert(spring.stiffness_N_m);
    }
    EXPECT_EQ(masses_kg, (std::set<double>{0.0005, 0.001, 0.002, 0.01}));
    EXPECT_EQ(stiffnesses_N_m, (std::set<double>{7.0, 100.0, 300.0}));  // one node holds no spring
  }
}

TEST(Lattice, DampingRatioIsThePapers) {
  EXPECT_NEAR(damping_from_ratio(1.0, 0.001, 100.0), 0.44721359549995793, 1e-15);  // sqrt(0.2)
  EXPECT_THROW(damping_from_ratio(-1.0, 0.001, 100.0), std::invalid_argument);
  EXPECT_THROW(damping_from_ratio(1.0, 0.0, 100.0), std::invalid_argument);
}

TEST(Lattice, RefusalsNameFieldValueAndRange) {
  LatticeSpec spec = reference_spec(4);
  spec.nodes[0] = 1;
  EXPECT_EQ(refusal(spec), "nodes x is 1, allowed: 2 to 200");
  spec = reference_spec(4);
  spec.nodes[2] = 201;
  EXPECT_EQ(refusal(spec), "nodes z is 201, allowed: 2 to 200");
  spec = reference_spec(4);
  spec.dimension = 4;
  EXPECT_EQ(refusal(spec), "dimension is 4, allowed: 2 or 3");
  spec = planar_spec(4);
  spec.nodes[1] = 3;
  EXPECT_NE(refusal(spec).find("nodes y is 3, allowed: 1"), std::string::npos);
  spec = reference_spec(4);
  spec.spacing_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(spec), "spacing_m is nan, allowed: positive and finite");
  spec = reference_spec(4);
  spec.mass_kg = 0;
  EXPECT_EQ(refusal(spec), "mass_kg is 0, allowed: positive and finite");
  spec = reference_spec(4);
  spec.stiffness_N_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(spec), "stiffness_N_m is inf, allowed: positive and finite");
  spec = reference_spec(4);
  spec.damping_N_s_m = -0.1;
  EXPECT_EQ(refusal(spec), "damping_N_s_m is -0.1, allowed: zero or positive, finite");
  spec = reference_spec(4);
  spec.origin_m.x = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(spec), "origin_m is not finite");
  spec = reference_spec(4);
  spec.fixed_nodes = {{0, 4, 0}};
  EXPECT_EQ(refusal(spec), "fixed_nodes y index is 4, allowed: 0 to 3");
  const MaterialRegion region{{0, 0, 0}, {3, 3, 1}, 0.001, 100.0, 0.0};
  spec = reference_spec(4);
  spec.regions = {region, region};
  EXPECT_EQ(refusal(spec), "");
  spec.regions[1].to_node = {3, 4, 1};
  EXPECT_EQ(refusal(spec), "regions[1].to_node y index is 4, allowed: 0 to 3");
  spec.regions[1] = region;
  spec.regions[1].from_node[2] = 2;
  EXPECT_EQ(refusal(spec), "regions[1].to_node z index is 1, allowed: 2 to 3");
  spec.regions[1] = region;
  spec.regions[1].from_node[0] = -1;
  EXPECT_EQ(refusal(spec), "regions[1].from_node x index is -1, allowed: 0 to 3");
  spec.regions = {region};
  spec.regions[0].mass_kg = 0;
  EXPECT_EQ(refusal(spec), "regions[0].mass_kg is 0, allowed: positive and finite");
  spec.regions = {{}};
  spec.regions[0].mass_kg = 0.001;
  EXPECT_EQ(refusal(spec), "regions[0].stiffness_N_m is 0, allowed: positive and finite");
  spec.regions = {region};
  spec.regions[0].damping_N_s_m = -1;
  EXPECT_EQ(refusal(spec), "regions[0].damping_N_s_m is -1, allowed: zero or positive, finite");
  spec = planar_spec(4);
  spec.fixed_faces = {Face::y_plus};
  EXPECT_NE(refusal(spec).find("fixed_faces is y+"), std::string::npos);
  spec = planar_spec(4);
  spec.gravity_m_s2.y = -9.81;
  EXPECT_NE(refusal(spec).find("gravity_m_s2.y is -9.81"), std::string::npos);
  spec = reference_spec(4);
  spec.fixed_faces.clear();
  EXPECT_NE(refusal(spec).find("no fixed node"), std::string::npos);
  spec.allow_unsupported = true;
  EXPECT_EQ(refusal(spec), "");
  spec = reference_spec(2);
  spec.fixed_faces = {Face::z_minus, Face::z_plus};
  EXPECT_NE(refusal(spec).find("all 8 nodes"), std::string::npos);
}

}  // namespace
}  // namespace palpate::host
