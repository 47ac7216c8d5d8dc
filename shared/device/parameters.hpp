// The haptic device's numbers: a PHANTOM Premium 1.5-class arm with three degrees of freedom.
//
// Sources, and which of them could be checked, stand in docs/sources.md: [C] Cavusoglu, Feygin, Tendick 2002;
// [M] mahilab/Phantom (parts, ratios and stops of a real Premium); [D] the maker's data sheet; [P] palpate's
// choice. Frames and signs: docs/units_and_frames.md.
#pragma once

#include <array>
#include <cstdint>

#include "shared/math/linear.hpp"

namespace palpate::device {

// One joint's drive and encoder, and how far the joint may turn while the device renders.
struct Joint {
  float transmission_ratio;      // motor turns per joint turn (capstan)
  float counts_per_rad;          // encoder counts per radian of the joint, > 0
  std::int8_t encoder_sign;      // +1 or -1: counts rise with the joint angle, or fall
  float min_rad, max_rad;        // software limits of the joint angle
  float coulomb_friction_N_m;    // for the plant; what the firmware compensates is a register
  float viscous_friction_N_m_s;  // per rad/s, likewise
};

// A link's moments of inertia about the axes of [C], at the points that its Lagrangian uses.
struct Moments {
  float xx_kg_m2, yy_kg_m2, zz_kg_m2;
};

// Masses and moments of the four moving bodies and the base, named as in [C]: a the forearm, c the rod
// parallel to the upper arm, be the upper arm with a motor as counterweight, df the forearm's drive link with
// the other motor.
struct Inertia {
  float mass_a_kg, mass_c_kg, mass_be_kg, mass_df_kg;
  Moments a, c, be, df;
  float base_yy_kg_m2;
  float l3_m;  // shoulder to the rod's drive end
  float l5_m;  // shoulder to the centre of be, along the upper arm (negative: behind the shoulder)
  float l6_m;  // shoulder to the centre of df, opposite to the forearm's direction
};

struct Parameters {
  float l1_m;  // upper arm
  float l2_m;  // forearm
  Inertia inertia;
  float gravity_m_s2;
  std::array<Joint, 3> joint;
  float elbow_min_rad,
      elbow_max_rad;  // limits of t3 - t2, the angle between forearm and the upper arm's normal
  // Distances kept from the two singularities: cos(t2 - t3) = 0, arm stretched or folded, where the tip loses
  // a direction; and the tip on the base's vertical axis, where turning the base does not move it.
  float min_elbow_cosine;
  float min_base_distance_m;
  float torque_constant_N_m_A;
  float continuous_current_A;  // that the motor bears for ever
  float peak_current_A;        // for a short time; set-points never exceed it
  float continuous_force_N;    // at the tip, of the whole device
  float max_force_N;
};

// Counts per radian of a joint: encoder lines on the motor shaft, four edges a line, through the
// transmission.
constexpr float counts_per_rad(float lines_per_turn, float transmission_ratio) {
  constexpr float kTwoPi = 6.28318531f;
  return 4.0f * lines_per_turn * transmission_ratio / kTwoPi;
}

// With 1,024 lines [M] the nominal resolution at the reference pose is 0.0248 mm by the base, 0.0294 mm by
// the upper arm and 0.0233 mm by the forearm: the 0.03 mm of [D].
inline constexpr Parameters kPremium15{
    .l1_m = 0.215f,                    // [C]
    .l2_m = 0.170f,                    // [C]
    .inertia = {.mass_a_kg = 0.0202f,  // all of inertia: [C]
                .mass_c_kg = 0.0249f,
                .mass_be_kg = 0.2359f,
                .mass_df_kg = 0.1906f,
                .a = {0.4864e-4f, 0.001843e-4f, 0.4864e-4f},
                .c = {0.959e-4f, 0.959e-4f, 0.0051e-4f},
                .be = {11.09e-4f, 10.06e-4f, 0.591e-4f},
                .df = {7.11e-4f, 0.629e-4f, 6.246e-4f},
                .base_yy_kg_m2 = 11.87e-4f,
                .l3_m = 0.0325f,
                .l5_m = -0.0368f,
                .l6_m = 0.0527f},
    .gravity_m_s2 = 9.80665f,  // standard gravity
    .joint = {{
        // Ratios: [M]. Limits: [P], inside the stops that [M] measured. Coulomb friction: [P], the 0.04 N of
        // [D] times l1
        // (joints 1 and 2) or l2 (joint 3). Viscous friction: [P], 0.005 N s/m at the tip times the same
        // lever squared.
        {13.3f, counts_per_rad(1024.0f, 13.3f), +1, -1.2f, 1.2f, 8.6e-3f, 2.3e-4f},
        {11.2f, counts_per_rad(1024.0f, 11.2f), +1, -0.9f, 1.7f, 8.6e-3f, 2.3e-4f},
        {11.2f, counts_per_rad(1024.0f, 11.2f), +1, -0.5f, 1.9f, 6.8e-3f, 1.4e-4f},
    }},
    .elbow_min_rad = -1.13f,    // [M]: -65 degrees
    .elbow_max_rad = 0.96f,     // [M]: 55 degrees
    .min_elbow_cosine = 0.40f,  // [P]: just outside the elbow's limits, so that it also guards other limits
    .min_base_distance_m = 0.05f,      // [P]
    .torque_constant_N_m_A = 0.0234f,  // [M]: Maxon RE 25, 118743
    .continuous_current_A = 1.24f,     // [M]: its nominal current; 1.4 N at the tip takes 1.15 A
    .peak_current_A = 7.0f,            // [P]: 8.5 N at the reference pose take 6.97 A on joint 2
    .continuous_force_N = 1.4f,        // [D]
    .max_force_N = 8.5f,               // [D]
};

}  // namespace palpate::device
