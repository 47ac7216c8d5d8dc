#include "host/msd/node_drives.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "host/msd/semi_implicit_euler.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

using test::message_of;

constexpr double kStep_s = 1e-4;
constexpr double kRounding_m = 1e-16;

class NodeDrivesTest : public ::testing::Test {
 protected:
  void step() {
    integrator_.predict(state_, {}, kStep_s);
    drives_.impose(state_);
    integrator_.finish(state_, kStep_s);
    ++steps_;
  }
  void step_until(double time_s) {
    while (steps_ * kStep_s < time_s - 0.5 * kStep_s) step();
  }
  Eigen::Vector3d displacement_m() const {
    return state_.position_m.col(drive_.node) - body_.rest_position_m().col(drive_.node);
  }

  Body body_ = make_lattice(test::reference_spec(4));
  NodeDrive drive_{body_.lattice()->node(1, 2, 3), 0.01, 0.03, 0.05, {0.001, 0.0, 0.02}};
  NodeDrives drives_{body_, {drive_}, kStep_s};
  SemiImplicitEuler integrator_{body_};
  BodyState state_ = body_.rest_state();
  int steps_ = 0;
};

TEST_F(NodeDrivesTest, FollowsItsScheduleToTheStep) {
  const Eigen::Vector3d way_m = to_eigen(drive_.displacement_m);
  step_until(0.01);
  EXPECT_LE(displacement_m().norm(), kRounding_m);
  EXPECT_EQ(drives_.upcoming(), std::vector<int>{drive_.node});
  EXPECT_FALSE(drives_.drove(drive_.node));
  step_until(0.02);  // half of the way, at the largest velocity of the least jerk: 15/8 of the mean
  EXPECT_LE((displacement_m() - 0.5 * way_m).norm(), kRounding_m);
  // The mean velocity of a step differs from that at its end by half a step of acceleration at most: 0 here,
  // and a sixth of step^2 of jerk, 60 way / duration^3.
  EXPECT_NEAR(state_.velocity_m_s.col(drive_.node).norm(), 15.0 / 8.0 * way_m.norm() / 0.02,
              10.0 * way_m.norm() / 8e-6 * kStep_s * kStep_s);
  EXPECT_TRUE(drives_.drove(drive_.node));
  step_until(0.03);
  EXPECT_LE((displacement_m() - way_m).norm(), kRounding_m);
  step_until(0.05);
  EXPECT_LE((displacement_m() - way_m).norm(), kRounding_m);
  EXPECT_LE(state_.velocity_m_s.col(drive_.node).norm(), kRounding_m / kStep_s);
  EXPECT_TRUE(drives_.upcoming().empty());
  step();  // free: it springs back
  EXPECT_FALSE(drives_.drove(drive_.node));
  EXPECT_LT(state_.velocity_m_s(2, drive_.node), 0.0);
}

// A driven node and one that a mass of 1e6 times its own keeps there press on their neighbours alike.
TEST_F(NodeDrivesTest, OthersFeelThePrescribedMotion) {
  step_until(0.04);
  BodyState external = body_.rest_state();
  SemiImplicitEuler reference(body_);
  NodeDrives same(body_, {drive_}, kStep_s);
  for (int n = 0; n < steps_; ++n) {
    BodyState predicted = external;
    reference.predict(predicted, {}, kStep_s);
    BodyState driven = predicted;
    same.impose(driven);
    // The documented force of the drive, as an external force.
    const Eigen::Vector3d force_N =
        body_.mass_kg(drive_.node) *
        (driven.velocity_m_s.col(drive_.node) - predicted.velocity_m_s.col(drive_.node)) / kStep_s;
    const NodalForce force{drive_.node, from_eigen(force_N)};
    reference.step(external, {&force, 1}, kStep_s);
  }
  constexpr double kAccumulated_m = 1e-13;  // rounding of some 400 steps
  EXPECT_LE((external.position_m - state_.position_m).cwiseAbs().maxCoeff(), kAccumulated_m);
}

TEST_F(NodeDrivesTest, StartsFromWhereTheNodeIs) {
  state_.position_m.col(drive_.node) += Eigen::Vector3d(0.0, 1e-3, 0.0);
  step_until(0.01);
  const Eigen::Vector3d before_m = displacement_m();
  step();
  EXPECT_LE((displacement_m() - before_m).norm(), 1e-6);  // 10 u^3 of the way with u = 1/200
  step_until(0.03);
  EXPECT_LE((displacement_m() - to_eigen(drive_.displacement_m)).norm(), kRounding_m);
}

TEST_F(NodeDrivesTest, RefusesBadDrivesByName) {
  const auto refused = [&](auto change) {
    NodeDrive drive = drive_;
    change(drive);
    return message_of<std::invalid_argument>([&] { NodeDrives(body_, {drive_, drive}, kStep_s); });
  };
  const auto later = [](NodeDrive& d) { d.start_s += 1.0, d.reach_s += 1.0, d.release_s += 1.0; };
  EXPECT_EQ(refused(later), "");
  EXPECT_NE(refused([](auto&) {}).find("body.drives[1].node = 57: must be a node that body.drives[0]"),
            std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.node = 64; }).find("must be 0 to 63"), std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.node = 0; }).find("not fixed"), std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.start_s = -1.0; }).find("start_s = -1"), std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.reach_s = d.start_s; }).find("reach_s = 0.01"), std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.release_s = 0.02; }).find("release_s = 0.02"), std::string::npos);
  EXPECT_NE(refused([&](auto& d) {
              later(d);
              d.displacement_m.x = std::numeric_limits<double>::quiet_NaN();
            }).find("body.drives[1].displacement_m.x = nan: must be finite"),
            std::string::npos);
}

}  // namespace
}  // namespace palpate::host
