#include "host/msd/body.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

using test::message_of;

BodyDescription two_nodes() {
  BodyDescription body;
  body.mass_kg = {0.001, 0.002};
  body.rest_position_m = Eigen::Matrix3Xd::Zero(3, 2);
  body.rest_position_m(0, 1) = 0.01;
  body.fixed = {true, false};
  body.springs = {{0, 1, 100.0, 0.1, 0.01}};
  return body;
}

std::string refusal(const BodyDescription& description) {
  return message_of<std::invalid_argument>([&] { const Body body(description); });
}

TEST(Body, RefusesWhatIsNoBody) {
  EXPECT_EQ(refusal(two_nodes()), "");
  BodyDescription body = two_nodes();
  body.mass_kg[1] = 0;
  EXPECT_NE(refusal(body).find("mass_kg[1] is 0"), std::string::npos);
  body = two_nodes();
  body.fixed.pop_back();
  EXPECT_NE(refusal(body).find("must be equal"), std::string::npos);
  body = two_nodes();
  body.rest_position_m(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refusal(body).find("rest_position_m"), std::string::npos);
  body = two_nodes();
  body.springs[0].stiffness_N_m = -1;
  EXPECT_NE(refusal(body).find("stiffness_N_m[0] is -1"), std::string::npos);
  body = two_nodes();
  body.springs[0].damping_N_s_m = -0.5;
  EXPECT_NE(refusal(body).find("damping_N_s_m[0] is -0.5"), std::string::npos);
  body = two_nodes();
  body.springs[0].rest_length_m = std::numeric_limits<double>::infinity();
  EXPECT_NE(refusal(body).find("rest_length_m[0]"), std::string::npos);
  body = two_nodes();
  body.springs[0].j = 2;
  EXPECT_NE(refusal(body).find("nodes 0 and 2"), std::string::npos);
  body = two_nodes();
  body.springs[0].j = 0;
  EXPECT_NE(refusal(body).find("two different nodes"), std::string::npos);
  body = two_nodes();
  body.planar = true;
  body.gravity_m_s2.y = 1;
  EXPECT_NE(refusal(body).find("gravity_m_s2.y"), std::string::npos);
  EXPECT_NE(refusal(BodyDescription{}).find("at least one node"), std::string::npos);
}

TEST(Body, RefusesOpenAndInconsistentSurfaces) {
  BodyDescription body = two_nodes();
  body.mass_kg.assign(4, 0.001);
  body.rest_position_m = Eigen::Matrix3Xd::Random(3, 4);
  body.fixed.assign(4, false);
  body.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  EXPECT_EQ(refusal(body), "");
  body.triangles.pop_back();
  EXPECT_NE(refusal(body).find("closed surface"), std::string::npos);
  body.triangles.push_back({0, 2, 3});
  EXPECT_NE(refusal(body).find("consistent orientation"), std::string::npos);
  body.triangles = {{0, 1, 4}};
  EXPECT_NE(refusal(body).find("corner 4"), std::string::npos);
}

TEST(Body, NeighboursShareTheEdgeTheyAreNamedFor) {
  const Body body = make_lattice(test::reference_spec(4));
  ASSERT_FALSE(body.triangles().empty());
  for (std::size_t t = 0; t < body.triangles().size(); ++t) {
    for (std::size_t e = 0; e < 3; ++e) {
      const int across = body.triangle_neighbours()[t][e];
      ASSERT_NE(across, static_cast<int>(t));
      const Triangle& other = body.triangles()[static_cast<std::size_t>(across)];
      EXPECT_EQ(std::count(other.begin(), other.end(), body.triangles()[t][e]), 1);
      EXPECT_EQ(std::count(other.begin(), other.end(), body.triangles()[t][(e + 1) % 3]), 1);
      const auto& back = body.triangle_neighbours()[static_cast<std::size_t>(across)];
      EXPECT_EQ(std::count(back.begin(), back.end(), static_cast<int>(t)), 1);
    }
  }
}

TEST(Body, DegreesOfFreedomCountTheMovableAxesOfFreeNodes) {
  for (const LatticeSpec& spec : {test::reference_spec(4), test::planar_spec(5)}) {
    const Body body = make_lattice(spec);
    int next = 0;
    for (int node = 0; node < body.node_count(); ++node)
      for (int axis = 0; axis < 3; ++axis) {
        const bool moves = !body.fixed(node) && !(body.planar() && axis == 1);
        EXPECT_EQ(body.dof(node, axis), moves ? next++ : -1);
      }
    EXPECT_EQ(body.dof_count(), next);
  }
}

TEST(Body, SpringsOfANodeAreThoseThatEndAtIt) {
  const Body body = test::irregular_body();
  for (int node = 0; node < body.node_count(); ++node) {
    const auto listed = body.springs_of(node);
    for (std::size_t s = 0; s < body.springs().size(); ++s) {
      const bool ends = body.springs()[s].i == node || body.springs()[s].j == node;
      EXPECT_EQ(std::count(listed.begin(), listed.end(), static_cast<int>(s)), ends ? 1 : 0);
    }
  }
}

}  // namespace
}  // namespace palpate::host
