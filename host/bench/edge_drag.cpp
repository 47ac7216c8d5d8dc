#include "host/bench/edge_drag.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "host/msd/lattice.hpp"
#include "host/session/simulation.hpp"
#include "shared/math/minimum_jerk.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host {
namespace {

constexpr double kPress_s = 0.3;
// From the corner of the body's top: inside a triangle, and 1.5 and 3.1 cells from the sides.
constexpr double kStartX_cells = 1.53, kStartY_cells = 3.1;
constexpr double kAcross_per_along = 0.19;

// A straight line with rest at both ends: speed and acceleration are zero there.
void append(std::vector<Vec3d>& tip_m, const Vec3d& to_m, std::uint32_t ticks) {
  const Vec3d from_m = tip_m.back();
  for (std::uint32_t i = 1; i <= ticks; ++i) {
    const double u = static_cast<double>(i) / ticks;
    tip_m.push_back(from_m + (to_m - from_m) * minimum_jerk(u));
  }
}

std::uint32_t ticks_of(double duration_s) {
  return static_cast<std::uint32_t>(std::lround(duration_s / kTick_s));
}

}  // namespace

EdgeJumps measure_edge_jumps(const EdgeDrag& drag) {
  LatticeSpec spec;
  spec.nodes = drag.nodes;
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  spec.origin_m = {0.0, 0.0, -spec.spacing_m * (drag.nodes[2] - 1)};
  const Body body = make_lattice(spec);

  const Vec3d above_m{kStartX_cells * spec.spacing_m, kStartY_cells * spec.spacing_m, drag.clear_m};
  const Vec3d pressed_m{above_m.x, above_m.y, -drag.depth_m};
  const Vec3d way_m = Vec3d{1.0, kAcross_per_along, 0.0} * (drag.cells * spec.spacing_m);

  SimulationConfig config;
  config.step_s = drag.step_s;
  config.surface = drag.surface;
  config.friction.elsewhere = {drag.friction, drag.friction};
  config.tip_m = {above_m};
  const std::uint32_t press = ticks_of(kPress_s);
  append(config.tip_m, pressed_m, press);
  append(config.tip_m, pressed_m + way_m, ticks_of(norm(way_m) / drag.speed_m_s));
  config.ticks = static_cast<std::uint32_t>(config.tip_m.size()) - 1;
  const SimulationResult run = simulate(body, body.rest_state(), config, {});

  EdgeJumps jumps;
  std::vector<double> at_edges_N;
  const auto changed = [&](std::size_t k) {
    return run.mode[k] == ContactMode::free || run.mode[k - 1] == ContactMode::free ||
           run.triangle[k] != run.triangle[k - 1];
  };
  const auto& force_N = run.mean_force_N;
  jumps.ticks = config.ticks - press;
  for (std::size_t k = press; k < force_N.size(); ++k) {
    jumps.largest_force_N = std::max(jumps.largest_force_N, norm(force_N[k]));
    jumps.free_ticks += run.mode[k] == ContactMode::free;
    jumps.crossings += changed(k);
    if (k + 1 == force_N.size()) break;
    const Vec3d before_N = force_N[k - 1] - force_N[k - 2], now_N = force_N[k] - force_N[k - 1],
                after_N = force_N[k + 1] - force_N[k];
    const double jump_N = norm(now_N - (before_N + after_N) * 0.5);
    jumps.largest_jump_any_N = std::max(jumps.largest_jump_any_N, jump_N);
    if (!changed(k) && !changed(k - 1)) continue;
    at_edges_N.push_back(jump_N);
    jumps.largest_change_N = std::max(jumps.largest_change_N, norm(now_N));
  }
  if (at_edges_N.empty()) return jumps;
  std::sort(at_edges_N.begin(), at_edges_N.end());
  jumps.jump_N = at_edges_N.back();
  jumps.median_jump_N = at_edges_N[at_edges_N.size() / 2];
  return jumps;
}

}  // namespace palpate::host
