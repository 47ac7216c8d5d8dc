// The full body alone: a scripted tip path, or no tip at all. This is also the reference that runs are
// compared with.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/integrator.hpp"
#include "host/msd/node_drives.hpp"
#include "host/session/surface_friction.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/math/linear.hpp"

namespace palpate::host {

// Called now and then with ticks done and ticks in all; returning false stops with
// std::runtime_error("stopped").
using Progress = std::function<bool(std::uint32_t, std::uint32_t)>;

struct SimulationConfig {
  Method method = Method::semi_implicit_euler;  // with a tip or drives: semi_implicit_euler only
  double step_s = 1e-4;                         // divides the servo tick
  ContactLaw<double> law{};
  SurfaceKind surface = SurfaceKind::smooth;
  FrictionSpec friction{};
  std::uint32_t ticks = 0;
  // Tip position at the end of tick 0 (the start), 1, ..., ticks; or empty: no tip.
  std::vector<Vec3d> tip_m;
  std::vector<NodeDrive> drives;
  std::optional<int> probe_node;  // with a tip: whose positions are wanted in every tick
  // Ticks at whose end the nodes are exported, increasing; 0 is the start.
  std::vector<std::uint32_t> export_ticks;
};

struct SimulationResult {
  // One entry per tick 1 ... ticks.
  std::vector<Vec3d> mean_force_N;      // of the tip on the body, averaged over the tick
  std::vector<ContactMode> mode;        // at its end
  std::vector<Vec3d> normal;            // BodyTick::normal
  std::vector<std::uint32_t> triangle;  // that is touched; 0 when free
  std::vector<BodyState> exported;      // one per export tick
  std::vector<Vec3d> probe_m;           // of the probe node, at the end of ticks 1 ... ticks
  // The body when the tip's force was largest; at the end where it never touched.
  BodyState state_at_peak;
  std::uint32_t peak_tick = 0;
};

// Throws std::invalid_argument for a configuration that does not fit together, an unstable step (naming the
// bound), a tip or a drive with another method than semi_implicit_euler, and as NodeDrives does.
SimulationResult simulate(const Body& body, const BodyState& start, const SimulationConfig& config,
                          const Progress& progress);

}  // namespace palpate::host
