// What the tests of host/session share: small bodies with their top at z = 0, and a tip that moves over them.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "host/msd/lattice.hpp"
#include "host/msd/test_bodies.hpp"
#include "host/session/body_surface.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host::test {

// The paper's material, bottom fixed, cells of 1 cm; x and y from 0, the top at z = 0.
inline Body block(int nodes_per_side, double damping_ratio = 1.0) {
  LatticeSpec spec = reference_spec(nodes_per_side, damping_ratio);
  spec.origin_m = {0.0, 0.0, -spec.spacing_m * (nodes_per_side - 1)};
  return make_lattice(spec);
}

// Tip positions at the ends of ticks 0, 1, ...: straight lines with rest at both ends, s(u) = 3 u^2 - 2 u^3.
class Path {
 public:
  explicit Path(const Vec3d& start_m) : tip_m{start_m} {}
  Path& to(Vec3d end_m, std::uint32_t ticks) {
    const Vec3d start_m = tip_m.back();
    for (std::uint32_t i = 1; i <= ticks; ++i) {
      const double u = static_cast<double>(i) / ticks;
      tip_m.push_back(start_m + (end_m - start_m) * (u * u * (3.0 - 2.0 * u)));
    }
    return *this;
  }
  Path& hold(std::uint32_t ticks) { return to(tip_m.back(), ticks); }
  [[nodiscard]] std::uint32_t ticks() const { return static_cast<std::uint32_t>(tip_m.size()) - 1; }

  std::vector<Vec3d> tip_m;
};

// A surface with its contact, stepped step by step.
struct Touched {
  Touched(const Body& body, const FrictionSpec& friction, const ContactLaw<double>& contact_law = {},
          double step_s = 1e-4)
      : surface(body, body.rest_state(), step_s, SurfaceKind::smooth, {}, friction), law(contact_law) {}

  // Calls after(contact before the step, contact after it) at each of the surface's steps.
  template <class After>
  void follow(const Path& path, After after) {
    const int steps = steps_per_tick(surface.step_s());
    for (std::size_t tick = 1; tick < path.tip_m.size(); ++tick) {
      const Vec3d& from_m = path.tip_m[tick - 1];
      Vec3d tip_m = from_m;
      for (int i = 1; i <= steps; ++i) {
        const Vec3d next_m = from_m + (path.tip_m[tick] - from_m) * (static_cast<double>(i) / steps);
        const ContactState<double> before = contact;
        step_contact(surface, contact, law, tip_m, next_m);
        tip_m = next_m;
        after(before, contact);
      }
    }
  }

  BodySurface surface;
  ContactLaw<double> law;
  ContactState<double> contact{};
};

}  // namespace palpate::host::test
