// What is set for one arm and its amplifiers: directions, offsets, gains, friction and weight. Registers of
// the board's node carry it (firmware/link/registers.hpp), `palpate calibrate` finds it.
//
// The defaults change nothing, to the bit: an ideal amplifier, encoders as in shared/device/parameters.hpp,
// the weight of the arm there, no friction compensated.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "shared/device/parameters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::firmware {

// The weight's torque about the joints, largest over all poses: of the upper arm times cos(t2), of the
// forearm times sin(t3) (shared/device/arm.cpp). The base turns about the vertical and has none.
constexpr Vec3f largest_gravity_torque(const device::Parameters& device) {
  const device::Inertia& in = device.inertia;
  const float moment_2 =
      device.l1_m * in.mass_a_kg + in.l5_m * in.mass_be_kg + 0.5f * device.l1_m * in.mass_c_kg;
  const float moment_3 = 0.5f * device.l2_m * in.mass_a_kg + in.l3_m * in.mass_c_kg - in.l6_m * in.mass_df_kg;
  return {0.0f, device.gravity_m_s2 * moment_2, device.gravity_m_s2 * moment_3};
}
inline constexpr Vec3f kNominalGravity_N_m = largest_gravity_torque(device::kPremium15);

using JointValues = std::array<float, 3>;  // by joint: base, upper arm, forearm

struct Tuning {
  JointValues encoder_sign{1.0f, 1.0f, 1.0f};  // -1 for an encoder that counts the other way round
  // told = gain * wanted - offset: told so, an amplifier lets the wanted current flow. It is one that lets
  // (told + offset) / gain flow.
  JointValues setpoint_offset_A{};
  JointValues setpoint_gain{1.0f, 1.0f, 1.0f};
  // A monitor that says m stands for gain * (m - offset).
  JointValues monitor_offset_A{};
  JointValues monitor_gain{1.0f, 1.0f, 1.0f};
  // As measured, and the share of it that the motors take over: 0 is none.
  JointValues coulomb_friction_N_m{};
  JointValues viscous_friction_N_m_s{};
  JointValues friction_share{};
  JointValues gravity_torque_N_m{kNominalGravity_N_m.x, kNominalGravity_N_m.y, kNominalGravity_N_m.z};

  bool operator==(const Tuning&) const = default;
};

// One field of Tuning as the register it is: its name, what it may be for each joint.
struct TuningField {
  std::string_view name;
  JointValues Tuning::*values;
  JointValues least, most;
};

// Offsets: a tenth of what converters span on nucleo_g474re (docs/hardware.md), gains a quarter: further off,
// an amplifier is not wired as it should be. Friction: 0.05 N m is 0.23 N at the tip, six times that of the
// arm. At the largest share, of both parts at 10 rad/s, a compensation is 0.056 N m, 0.22 A.
// Weight: 0.3 N m takes 1.15 A, less than the motors bear for ever.
inline constexpr float kMaxFrictionShare = 0.8f;
inline constexpr std::array<TuningField, 9> kTuningFields{{
    {"encoder.sign", &Tuning::encoder_sign, {-1.0f, -1.0f, -1.0f}, {1.0f, 1.0f, 1.0f}},
    {"setpoint.offset_a", &Tuning::setpoint_offset_A, {-0.8f, -0.8f, -0.8f}, {0.8f, 0.8f, 0.8f}},
    {"setpoint.gain", &Tuning::setpoint_gain, {0.75f, 0.75f, 0.75f}, {1.25f, 1.25f, 1.25f}},
    {"monitor.offset_a", &Tuning::monitor_offset_A, {-1.2f, -1.2f, -1.2f}, {1.2f, 1.2f, 1.2f}},
    {"monitor.gain", &Tuning::monitor_gain, {0.75f, 0.75f, 0.75f}, {1.25f, 1.25f, 1.25f}},
    {"friction.coulomb_n_m", &Tuning::coulomb_friction_N_m, {}, {0.05f, 0.05f, 0.05f}},
    {"friction.viscous_n_m_s", &Tuning::viscous_friction_N_m_s, {}, {2e-3f, 2e-3f, 2e-3f}},
    {"friction.compensated_share",
     &Tuning::friction_share,
     {},
     {kMaxFrictionShare, kMaxFrictionShare, kMaxFrictionShare}},
    {"gravity.torque_n_m", &Tuning::gravity_torque_N_m, {0.0f, -0.3f, -0.3f}, {0.0f, 0.3f, 0.3f}},
}};

// May the field have these values? NaN may not; a sign is 1 or -1. Any context.
constexpr bool is_allowed(const TuningField& field, const JointValues& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= field.least[i] && values[i] <= field.most[i])) return false;
    if (field.values == &Tuning::encoder_sign && values[i] != 1.0f && values[i] != -1.0f) return false;
  }
  return true;
}
constexpr bool is_allowed(const Tuning& tuning) {
  for (const TuningField& field : kTuningFields)
    if (!is_allowed(field, tuning.*field.values)) return false;
  return true;
}

// As a board keeps it. Another version's is not read.
inline constexpr std::uint32_t kTuningVersion = 1;
inline constexpr std::size_t kTuningBytes = sizeof(std::uint32_t) + sizeof(Tuning);
static_assert(sizeof(Tuning) == sizeof(JointValues) * kTuningFields.size());
void pack_tuning(const Tuning& tuning, std::span<std::uint8_t, kTuningBytes> out);
// False, and `tuning` stays as it is: of another version, or out of range.
bool unpack_tuning(std::span<const std::uint8_t, kTuningBytes> bytes, Tuning& tuning);

// Torque that takes over a share of the friction of joints that move at these speeds. Of Coulomb's it rises
// to its share at kFullFriction_rad_s, 1 cm/s at the tip, and is zero at rest: so it is less than the
// friction itself at every speed, and opposed to motion or none where the speed is known late. Interrupt
// context.
inline constexpr float kFullFriction_rad_s = 0.05f;
inline constexpr float kFastestCompensated_rad_s = 10.0f;
Vec3f friction_compensation(const Tuning& tuning, const Vec3f& joint_rad_s);

}  // namespace palpate::firmware
