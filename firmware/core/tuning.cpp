#include "firmware/core/tuning.hpp"

#include <algorithm>
#include <cstring>

namespace palpate::firmware {

void pack_tuning(const Tuning& tuning, std::span<std::uint8_t, kTuningBytes> out) {
  std::memcpy(out.data(), &kTuningVersion, sizeof kTuningVersion);
  std::memcpy(out.data() + sizeof kTuningVersion, &tuning, sizeof tuning);
}

bool unpack_tuning(std::span<const std::uint8_t, kTuningBytes> bytes, Tuning& tuning) {
  std::uint32_t version = 0;
  std::memcpy(&version, bytes.data(), sizeof version);
  Tuning read;
  std::memcpy(&read, bytes.data() + sizeof version, sizeof read);
  if (version != kTuningVersion || !is_allowed(read)) return false;
  tuning = read;
  return true;
}

Vec3f friction_compensation(const Tuning& tuning, const Vec3f& joint_rad_s) {
  Vec3f torque_N_m{};
  for (std::size_t i = 0; i < 3; ++i) {
    const float direction = std::clamp(joint_rad_s[i] / kFullFriction_rad_s, -1.0f, 1.0f);
    const float speed_rad_s =
        std::clamp(joint_rad_s[i], -kFastestCompensated_rad_s, kFastestCompensated_rad_s);
    torque_N_m[i] = tuning.friction_share[i] * (tuning.coulomb_friction_N_m[i] * direction +
                                                tuning.viscous_friction_N_m_s[i] * speed_rad_s);
  }
  return torque_N_m;
}

}  // namespace palpate::firmware
