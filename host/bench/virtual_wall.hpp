// The stiffest virtual wall that creates no energy, by servo rate, delay, encoder and damping: the Z-width of
// a device (Colgate, Brown, IEEE ICRA 1994), with and without the firmware's passivity controller.
//
// One axis. A device (mass, viscous and Coulomb friction) is sampled, quantized and held; the wall, spring
// and damper in discrete time, only pushes. A passive hand holds it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::host::bench {

// What is held: of the axis of a PHANTOM 1.5-class device, shared/device/parameters.hpp.
struct WallDevice {
  double mass_kg = 0.05;
  double viscosity_N_s_m = 0.005;
  double friction_N = 0.04;  // Coulomb's
  double most_force_N = 8.5;
};

// A passive hand: a mass that moves with the tool, a spring and damper to a place, and a constant push into
// the wall.
struct WallHand {
  double mass_kg = 0.0;
  double stiffness_N_m = 0.0;
  double damping_N_s_m = 0.0;
  double push_N = 1.0;
};

struct WallServo {
  double rate_Hz = 1000.0;
  std::uint32_t delay_ticks = 0;  // from the sample to the force
  double count_m = 30e-6;         // of the encoder; 0: none
  bool is_controlled = false;     // by firmware/core/passivity.hpp
};

struct Wall {
  double stiffness_N_m = 0.0;
  double damping_N_s_m = 0.0;  // on the difference of two samples
};

// Most that the hand has got and not given, at any time, J: 0 for a passive device. The tip begins 5 mm in
// front of the wall, at rest. The run ends early once it is more than `most_J`.
double created_energy_J(const WallDevice& device, const WallHand& hand, const WallServo& servo,
                        const Wall& wall, double duration_s, double most_J);

// The hands that a wall must be passive with: light, heavy, in a loose and in a firm grip.
const std::vector<WallHand>& wall_hands();

// Greatest stiffness up to which all that were tried, 20 a decade from 10 N/m to 1e5, create at most `most_J`
// with each of the hands; nothing: the first does not.
std::optional<double> stiffest_wall_N_m(const WallDevice& device, const WallServo& servo,
                                        double damping_N_s_m, double duration_s, double most_J);

}  // namespace palpate::host::bench
