#include "host/plant/plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "shared/device/actuation.hpp"
#include "shared/device/arm.hpp"

namespace palpate::plant {
namespace {

constexpr double kTick_s = 1e-3;
constexpr std::array<float, 3> kNoCurrent{};

TipPath place(const Vec3d& position_m) {
  return TipPath::minimum_jerk({{0.0, position_m}});
}

// No friction, no stops, nobody holding: energy is conserved.
PlantParameters free_arm() {
  PlantParameters parameters;
  for (device::Joint& joint : parameters.arm.device.joint)
    joint.coulomb_friction_N_m = joint.viscous_friction_N_m_s = 0.0f;
  parameters.arm.stop_stiffness_N_m_rad = 0.0;
  parameters.grip = 0.0;
  return parameters;
}

std::array<float, 3> to_array(const Vec3f& v) {
  return {v.x, v.y, v.z};
}

// Lets the free arm fall and swing from a start where all three joints move: a push by motor currents, then
// free.
Plant swinging(double substep_s) {
  PlantParameters parameters = free_arm();
  parameters.substep_s = substep_s;
  parameters.amplifiers.bandwidth_Hz = 20.0;  // slow enough for the coarsest substep to follow
  Plant plant(parameters, place({0.02, -0.02, 0.03}));
  plant.advance({0.5f, 0.3f, -0.2f}, true, 0.05);
  return plant;
}

TEST(Plant, FreeArmConservesEnergy) {
  // Measured: 1e-15 J, which is rounding, with 0.17 J in motion; the bound leaves a factor of twenty.
  constexpr double kDrift_J = 2e-14;
  Plant plant = swinging(50e-6);
  const double start_J = plant.arm().energy_J(plant.joint_rad(), plant.joint_rad_s());
  double worst_J = 0.0, largest_kinetic_J = 0.0;
  for (int tick = 0; tick < 1000; ++tick) {
    plant.advance(kNoCurrent, false, kTick_s);
    worst_J =
        std::max(worst_J, std::abs(plant.arm().energy_J(plant.joint_rad(), plant.joint_rad_s()) - start_J));
    const Mat3d mass_kg_m2 = plant.arm().mass_matrix_kg_m2(plant.joint_rad());
    largest_kinetic_J =
        std::max(largest_kinetic_J, 0.5 * dot(plant.joint_rad_s(), mass_kg_m2 * plant.joint_rad_s()));
  }
  RecordProperty("worst_1e-15_J", std::to_string(worst_J * 1e15));
  RecordProperty("kinetic_J", std::to_string(largest_kinetic_J));
  EXPECT_GT(largest_kinetic_J, 0.1);  // it did move
  EXPECT_LT(worst_J, kDrift_J);
}

TEST(Plant, IntegratorIsOfFourthOrder) {
  const auto state_after = [](double substep_s) {
    Plant plant = swinging(substep_s);
    plant.advance(kNoCurrent, false, 0.5);
    return plant.joint_rad();
  };
  const Vec3d reference_rad = state_after(50e-6);
  const double coarse_rad = norm(state_after(1e-3) - reference_rad);
  const double fine_rad = norm(state_after(0.5e-3) - reference_rad);
  const double order = std::log2(coarse_rad / fine_rad);
  RecordProperty("order", std::to_string(order));
  EXPECT_NEAR(order, 4.0, 0.3);
}

TEST(Plant, CompensatedGravityHoldsTheArm) {
  // Float rounding of torque and current, 3e-8 N m, on 0.6e-3 kg m^2 (determinant over M22).
  constexpr double kAcceleration_rad_s2 = 5e-5;
  PlantParameters parameters;
  parameters.grip = 0.0;
  for (const Vec3d& tip_m : {Vec3d{}, Vec3d{0.05, 0.03, 0.06}, Vec3d{-0.06, -0.05, 0.02}}) {
    Plant plant(parameters, place(tip_m));
    const Vec3d start_rad = plant.joint_rad();
    const Vec3f joint_rad{static_cast<float>(start_rad.x), static_cast<float>(start_rad.y),
                          static_cast<float>(start_rad.z)};
    const Vec3f gravity_N_m = device::gravity_torque(device::kPremium15, joint_rad);
    const Vec3f current_A = device::motor_currents(device::kPremium15, gravity_N_m).current_A;
    const Vec3d drive_N_m =
        plant.arm().drive_torque_N_m({static_cast<double>(current_A.x), static_cast<double>(current_A.y),
                                      static_cast<double>(current_A.z)});
    EXPECT_LT(norm(plant.arm().acceleration_rad_s2(start_rad, {}, drive_N_m, {})), kAcceleration_rad_s2);

    // The same in closed loop from the encoders, nobody holding: friction takes the rest, the tip stays for a
    // second.
    for (int tick = 0; tick < 1000; ++tick) {
      const Vec3f read_rad = device::joint_angles(device::kPremium15, plant.encoder_counts(), {});
      const Vec3f torque_N_m = device::gravity_torque(device::kPremium15, read_rad);
      plant.advance(to_array(device::motor_currents(device::kPremium15, torque_N_m).current_A), true,
                    kTick_s);
    }
    constexpr double kCreep_m = 30e-6;  // one count
    EXPECT_LT(norm(plant.tip_position_m() - plant.arm().tip_position_m(start_rad)), kCreep_m);
  }
}

TEST(Plant, StaticStiffnessIsThatOfHandAndGripInSeries) {
  PlantParameters parameters;
  for (device::Joint& joint : parameters.arm.device.joint) joint.coulomb_friction_N_m = 0.0f;
  for (const double grip : {1.0, 0.4}) {
    parameters.grip = grip;
    Plant plant(parameters, place({}));
    // Motors push the tip to the right with 2 N, and hold the arm's weight; after a second everything is at
    // rest.
    const Vec3f push_N{2.0f, 0.0f, 0.0f};
    for (int tick = 0; tick < 1000; ++tick) {
      const Vec3f joint_rad = device::joint_angles(device::kPremium15, plant.encoder_counts(), {});
      const device::Pose pose = device::evaluate(device::kPremium15, joint_rad);
      const Vec3f torque_N_m = device::joint_torque(pose, push_N) + pose.gravity_torque_N_m;
      plant.advance(to_array(device::motor_currents(device::kPremium15, torque_N_m).current_A), true,
                    kTick_s);
    }
    const HandParameters& hand = parameters.hand;
    const double compliance_m_N = 1.0 / hand.stiffness_N_m + 1.0 / (grip * hand.grip_stiffness_N_m);
    // The torque comes from counts of 0.03 mm at most: 0.5 count / l1 * 2 N is 0.14 mN of side force.
    constexpr double kError_m = 2e-6;
    EXPECT_NEAR(plant.tip_position_m().x, 2.0 * compliance_m_N, kError_m);
    EXPECT_NEAR(plant.hand_force_N().x, -2.0, 1e-3);
    EXPECT_NEAR(plant.hand_position_m().x, 2.0 / hand.stiffness_N_m, kError_m);
    EXPECT_LT(norm(plant.tip_velocity_m_s()), 1e-4);
  }
}

TEST(Plant, TipFollowsTheIntendedPath) {
  // The demo's movement against a force of 2.5 N: within 2 mm (the requirement), more than 0.5 mm (it is no
  // robot).
  const TipPath path = TipPath::minimum_jerk({{0.0, {0.0, 0.0, 0.02}},
                                              {1.0, {0.0, 0.0, -0.005}},
                                              {1.5, {0.0, 0.0, -0.005}},
                                              {3.5, {0.03, 0.0, -0.005}},
                                              {4.5, {0.03, 0.0, 0.02}}});
  Plant plant(PlantParameters{}, path);
  double worst_m = 0.0;
  for (int tick = 0; tick < 5000; ++tick) {
    const Vec3f joint_rad = device::joint_angles(device::kPremium15, plant.encoder_counts(), {});
    const device::Pose pose = device::evaluate(device::kPremium15, joint_rad);
    const Vec3f torque_N_m =
        device::joint_torque(pose, {-1.5f, 0.0f, 2.0f}) + pose.gravity_torque_N_m;  // drag and pressure
    plant.advance(to_array(device::motor_currents(device::kPremium15, torque_N_m).current_A), true, kTick_s);
    worst_m = std::max(worst_m, norm(plant.tip_position_m() - plant.intended_position_m()));
  }
  RecordProperty("worst_um", std::to_string(worst_m * 1e6));
  EXPECT_LT(worst_m, 2e-3);
  EXPECT_GT(worst_m, 0.5e-3);
}

TEST(Plant, LettingGoGivesZeroForceAndTheArmFalls) {
  Plant plant(PlantParameters{}, place({0.0, -0.03, 0.02}));
  plant.advance(kNoCurrent, false, 0.1);
  EXPECT_GT(norm(plant.hand_force_N()), 0.1);  // it carries the arm's weight
  plant.set_grip(0.0);
  EXPECT_EQ(plant.hand_force_N(), Vec3d{});
  const double start_J = plant.arm().energy_J(plant.joint_rad(), {});
  for (int i = 0; i < 30; ++i) plant.advance(kNoCurrent, false, 0.1);
  EXPECT_EQ(plant.hand_force_N(), Vec3d{});
  EXPECT_LT(plant.arm().energy_J(plant.joint_rad(), {}), start_J);
  // It ends in the stops, at rest but for the creep of the smoothed friction.
  EXPECT_LT(norm(plant.joint_rad_s()), 1e-2);
  const Vec3d& joint_rad = plant.joint_rad();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_GT(joint_rad[i], static_cast<double>(device::kPremium15.joint[i].min_rad) - 0.04);
    EXPECT_LT(joint_rad[i], static_cast<double>(device::kPremium15.joint[i].max_rad) + 0.04);
  }
}

TEST(Plant, AmplifiersLagBehindAndCanBeDisabled) {
  Plant plant(PlantParameters{}, place({}));
  EXPECT_EQ(plant.measured_current_A(), kNoCurrent);
  plant.advance({0.5f, -0.25f, 0.125f}, true, kTick_s);
  const double reached = 1.0 - std::exp(-2.0 * M_PI * 1000.0 * kTick_s);
  constexpr float kFloatRounding_A = 1e-7f;
  EXPECT_NEAR(plant.measured_current_A()[0], static_cast<float>(0.5 * reached), kFloatRounding_A);
  EXPECT_NEAR(plant.measured_current_A()[1], static_cast<float>(-0.25 * reached), kFloatRounding_A);
  plant.advance({0.5f, -0.25f, 0.125f}, false, kTick_s);
  EXPECT_EQ(plant.measured_current_A(), kNoCurrent);
}

TEST(Plant, EncodersReadTheReferenceInTheReferencePose) {
  PlantParameters parameters;
  parameters.encoder_reference = {5, std::numeric_limits<std::int32_t>::max(), -7};
  const Plant plant(parameters, place({}));
  EXPECT_EQ(plant.encoder_counts(), parameters.encoder_reference);
  parameters.encoder_reference = {std::numeric_limits<std::int32_t>::max(), 0, 0};
  const Plant right(parameters, place({0.05, 0.0, 0.0}));  // the base's counter has wrapped around
  const Vec3f joint_rad =
      device::joint_angles(device::kPremium15, right.encoder_counts(), parameters.encoder_reference);
  EXPECT_NEAR(device::forward_kinematics(device::kPremium15, joint_rad).x, 0.05f, 3e-5f);
}

TEST(Plant, EveryPermittedHandIsIntegratedStably) {
  // The corners of the parameters' ranges, pushed for half a second: the motion stays near the path. Hands
  // that cannot hold the tip (no stiffness, no grip spring) are left out; without damping the push of 1 N may
  // ring up to twice its static deflection.
  for (const double mass_kg : {0.01, 10.0})
    for (const double damping_N_s_m : {0.0, 100.0})
      for (const double grip_damping_N_s_m : {0.0, 60.0})
        for (const double stiffness_N_m : {1e3, 2e4}) {
          PlantParameters parameters;
          parameters.hand = {.mass_kg = mass_kg,
                             .damping_N_s_m = damping_N_s_m,
                             .stiffness_N_m = stiffness_N_m,
                             .grip_stiffness_N_m = stiffness_N_m,
                             .grip_damping_N_s_m = grip_damping_N_s_m};
          Plant plant(parameters, place({}));
          for (int tick = 0; tick < 500; ++tick) {
            plant.advance({0.69f, 0.0f, 0.0f}, true, kTick_s);  // 1 N to the right
            ASSERT_LT(norm(plant.tip_position_m()), 2.5 * (2.0 / stiffness_N_m) + 1e-3)
                << mass_kg << " kg, " << damping_N_s_m << ", " << grip_damping_N_s_m << " N s/m, "
                << stiffness_N_m;
          }
        }
}

// A path with all three joints in motion.
TipPath excursion() {
  return TipPath::minimum_jerk({{0.0, {}}, {0.3, {0.03, 0.02, -0.02}}, {0.5, {-0.01, 0.0, 0.01}}});
}

TEST(ScriptedTip, IsOnThePathWhateverTheMotorsDo) {
  constexpr double kRounding_m = 1e-15;  // of the kinematics and their inverse
  const TipPath path = excursion();
  Plant plant({.hand_kind = HandKind::scripted}, path);
  for (int tick = 1; tick <= 600; ++tick) {
    plant.advance({5.0f, -3.0f, static_cast<float>(tick % 7)}, tick % 2 == 0, kTick_s);
    EXPECT_LE(norm(plant.tip_position_m() - path.at(plant.time_s()).position_m), kRounding_m) << tick;
    // The encoders read the same angles, to half a count: 0.03 mm at the tip.
    const Vec3f read_m = device::forward_kinematics(
        device::kPremium15, device::joint_angles(device::kPremium15, plant.encoder_counts(), {}));
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(static_cast<double>(read_m[axis]), plant.tip_position_m()[axis], 6e-5);
  }
}

// What hand and motors put in is what the arm takes up. The force is that of the end of a tick with the mean
// acceleration over it: the balance closes to first order in the tick.
TEST(ScriptedTip, HandForceBalancesTheArmsEnergy) {
  const auto error_J = [](double tick_s) {
    PlantParameters parameters = free_arm();
    parameters.hand_kind = HandKind::scripted;
    Plant plant(parameters, excursion());
    const auto energy_J = [&] { return plant.arm().energy_J(plant.joint_rad(), plant.joint_rad_s()); };
    const double start_J = energy_J();
    double work_J = 0.0, worst_J = 0.0, largest_J = 0.0;
    const auto ticks = static_cast<int>(std::lround(0.5 / tick_s));
    for (int tick = 0; tick < ticks; ++tick) {
      plant.advance({0.2f, -0.3f, 0.1f}, true, tick_s);
      const auto current_A = plant.measured_current_A();
      const Vec3d drive_N_m =
          plant.arm().drive_torque_N_m({static_cast<double>(current_A[0]), static_cast<double>(current_A[1]),
                                        static_cast<double>(current_A[2])});
      work_J += tick_s *
                (dot(plant.hand_force_N(), plant.tip_velocity_m_s()) + dot(drive_N_m, plant.joint_rad_s()));
      worst_J = std::max(worst_J, std::abs(energy_J() - start_J - work_J));
      largest_J = std::max(largest_J, std::abs(work_J));
    }
    EXPECT_GT(largest_J, 0.005);
    EXPECT_LT(worst_J, 0.05 * largest_J);
    return worst_J;
  };
  EXPECT_NEAR(error_J(1e-3) / error_J(5e-4), 2.0, 0.1);
}

TEST(ScriptedTip, MayNotLeaveTheWorkspace) {
  Plant plant({.hand_kind = HandKind::scripted}, TipPath::minimum_jerk({{0.0, {}}, {0.1, {0.0, -0.5, 0.0}}}));
  EXPECT_THROW(
      {
        for (int tick = 0; tick < 100; ++tick) plant.advance(kNoCurrent, false, kTick_s);
      },
      std::invalid_argument);
}

// The board's inputs of then: counts by definition, currents because set-points and steps are those of then.
TEST(RecordedMotion, GivesTheBoardWhatItReadThen) {
  for (const HandKind kind : {HandKind::impedance, HandKind::scripted}) {
    PlantParameters parameters;
    parameters.hand_kind = kind;
    parameters.encoder_reference = {100, -200, std::numeric_limits<std::int32_t>::max() - 3};
    Plant plant(parameters, TipPath::minimum_jerk({{0.0, {}}, {0.2, {0.02, 0.01, 0.03}}}));
    RecordedMotion motion;
    std::vector<std::array<float, 3>> current_A;
    constexpr int kTicks = 200;
    const auto setpoint_A = [](int tick) {
      return std::array<float, 3>{0.01f * static_cast<float>(tick), 0.2f, -0.3f};
    };
    for (int tick = 0; tick < kTicks; ++tick) {
      motion.encoder_count.push_back(plant.encoder_counts());
      motion.tip_m.push_back(plant.tip_position_m());
      current_A.push_back(plant.measured_current_A());
      plant.advance(setpoint_A(tick), tick > 50, kTick_s);
    }
    Plant again(parameters, motion);
    for (int tick = 0; tick < kTicks; ++tick) {
      const auto row = static_cast<std::size_t>(tick);
      EXPECT_EQ(again.encoder_counts(), motion.encoder_count[row]);
      EXPECT_EQ(again.tip_position_m(), motion.tip_m[row]);
      EXPECT_EQ(again.intended_position_m(), motion.tip_m[row]);
      EXPECT_EQ(again.measured_current_A(), current_A[row]);
      EXPECT_TRUE(std::isnan(again.hand_force_N().x));
      again.advance(setpoint_A(tick), tick > 50, kTick_s);
    }
  }
}

TEST(RecordedMotion, IsFoundByTheTickAndRestsAtItsEnd) {
  Plant plant(PlantParameters{},
              RecordedMotion{{{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {{}, {}, {0.0, 0.0, 0.1}}});
  plant.advance(kNoCurrent, false, 2.0 * kTick_s);  // over a tick that the board lost
  EXPECT_EQ(plant.encoder_counts()[0], 3);
  plant.advance(kNoCurrent, false, kTick_s);
  EXPECT_EQ(plant.encoder_counts()[0], 3);
  EXPECT_EQ(plant.tip_position_m().z, 0.1);
}

TEST(RecordedMotion, RefusesBadInput) {
  EXPECT_THROW(Plant(PlantParameters{}, RecordedMotion{}), std::invalid_argument);
  EXPECT_THROW(Plant(PlantParameters{}, RecordedMotion{{{1, 2, 3}}, {}}), std::invalid_argument);
}

TEST(Plant, AGuidedHandForgetsItsPath) {
  // Both go to the same place, one by its path, one by its guide.
  Plant guided(PlantParameters{}, place({})),
      scripted(PlantParameters{}, TipPath::samples({{0.0, {}}, {0.1, {0.01, 0.0, 0.0}}}));
  for (int tick = 0; tick < 100; ++tick) {
    guided.guide({{0.1 * tick * kTick_s, 0.0, 0.0}, {0.1, 0.0, 0.0}});
    guided.advance(kNoCurrent, false, kTick_s);
    scripted.advance(kNoCurrent, false, kTick_s);
  }
  EXPECT_NEAR(norm(guided.tip_position_m() - scripted.tip_position_m()), 0.0, 1e-9);
  EXPECT_GT(guided.tip_position_m().x, 0.005);
  EXPECT_THROW(guided.guide({{std::nan(""), 0.0, 0.0}, {}}), std::invalid_argument);
  Plant other(PlantParameters{.hand_kind = HandKind::scripted}, place({}));
  EXPECT_THROW(other.guide({}), std::invalid_argument);
}

TEST(Plant, TwoRunsAreEqualToTheBit) {
  const auto run = [] {
    Plant plant(PlantParameters{}, TipPath::minimum_jerk({{0.0, {}}, {0.2, {0.02, 0.01, 0.03}}}));
    for (int tick = 0; tick < 200; ++tick) plant.advance({0.1f, 0.2f, -0.3f}, tick > 50, kTick_s);
    return plant;
  };
  const Plant first = run(), second = run();
  EXPECT_EQ(first.joint_rad(), second.joint_rad());
  EXPECT_EQ(first.hand_position_m(), second.hand_position_m());
  EXPECT_EQ(first.time_s(), second.time_s());
}

TEST(Plant, RefusesBadInput) {
  EXPECT_THROW(Plant(PlantParameters{}, place({0.0, -0.3, 0.0})), std::invalid_argument);
  Plant plant(PlantParameters{}, place({}));
  EXPECT_THROW(plant.set_grip(1.01), std::invalid_argument);
  EXPECT_THROW(plant.set_grip(std::nan("")), std::invalid_argument);
  EXPECT_THROW(plant.advance({std::nanf(""), 0.0f, 0.0f}, true, kTick_s), std::invalid_argument);
  EXPECT_THROW(plant.advance(kNoCurrent, true, 0.0), std::invalid_argument);
  EXPECT_THROW(Plant(PlantParameters{.substep_s = 0.1}, place({})), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::plant
