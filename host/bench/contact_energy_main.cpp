// Prints as JSON what the contact creates while the tip goes round closed loops
// (docs/decisions/contact_energy.md).
#include <array>
#include <cstdio>

#include "host/bench/contact_energy.hpp"
#include "host/msd/lattice.hpp"

namespace {

using namespace palpate;
using namespace palpate::host;
using namespace palpate::host::bench;

constexpr double kStep_s = 1e-4;
constexpr double kDepth_m = 0.003;
constexpr double kSpacing_m = 0.01;

Body body_of(std::array<int, 3> nodes, double damping_ratio) {
  LatticeSpec spec;
  spec.nodes = nodes;
  spec.damping_N_s_m = damping_from_ratio(damping_ratio, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  return make_lattice(spec);
}

struct Place {
  const char* name;
  Loop loop;
};

// Node (5, 5) of the top is at 5 cm, 5 cm; the cell's diagonal runs through its middle.
Loop circle(double x_m, double y_m, double radius_m) {
  Loop loop;
  loop.x_m = x_m;
  loop.y_m = y_m;
  loop.half_width_m = radius_m;
  return loop;
}
const std::array<Place, 4> kPlaces{{{"triangle", circle(0.0533, 0.0533, 0.0015)},
                                    {"edge", circle(0.055, 0.05, 0.002)},
                                    {"node", circle(0.05, 0.05, 0.003)},
                                    {"cells", circle(0.055, 0.055, 0.009)}}};

bool first_row = true;

void print(const char* runtime, const char* place, SurfaceKind kind, double ratio, double mu, double speed,
           const EnergyLoop& r) {
  std::printf(
      "%s{\"runtime\": \"%s\", \"loop\": \"%s\", \"surface\": \"%s\", \"damping_ratio\": %g, \"friction\": "
      "%g, "
      "\"speed_m_s\": %g, \"hand_J\": %.4g, \"body_J\": %.4g, \"friction_J\": %.4g, \"first_contact_J\": "
      "%.3g, \"created_J\": %.3g, \"bound_J\": %.3g, \"largest_step_J\": %.3g, \"integrator_J\": %.3g, "
      "\"mean_force_N\": %.3g, \"largest_force_N\": %.3g, \"crossed\": %d, \"lost\": %d}",
      first_row ? "" : ",\n", runtime, place, kind == SurfaceKind::flat ? "flat" : "smooth", ratio, mu, speed,
      r.account.hand_J, r.account.body_J, r.account.friction_J, r.account.first_contact_J,
      r.account.created_J, r.bound_J(), r.account.largest_step_J, r.integrator_J, r.mean_force_N,
      r.largest_force_N, r.triangles_crossed, r.lost);
  first_row = false;
}

}  // namespace

int main() {
  constexpr std::array<int, 3> kNodes{12, 12, 5};
  std::putchar('[');
  for (const double ratio : {1.0, 0.1}) {
    const Body body = body_of(kNodes, ratio);
    for (const SurfaceKind kind : {SurfaceKind::smooth, SurfaceKind::flat})
      for (Place place : kPlaces)
        for (const double mu : {0.0, 0.3, 1.0})
          for (const double speed : {0.02, 0.2}) {
            place.loop.top_m = kSpacing_m * (kNodes[2] - 1);
            place.loop.depth_m = kDepth_m;
            place.loop.speed_m_s = speed;
            const auto path = tip_path(place.loop);
            print("patch", place.name, kind, ratio, mu, speed,
                  patch_loop(body, kind, mu, {place.loop.x_m, place.loop.y_m, place.loop.top_m}, path));
            print("body", place.name, kind, ratio, mu, speed, full_body_loop(body, kind, mu, kStep_s, path));
            std::fflush(stdout);
          }
  }
  std::puts("]");
  return 0;
}
