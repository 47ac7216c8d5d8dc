#include "host/session/closed_loop.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <array>
#include <memory>
#include <string>
#include <utility>

#include "host/link/metered_link.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/loop_datasets.hpp"
#include "host/python/bindings/progress.hpp"
#include "host/python/bindings/scene.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

// The hand would pull the arm against its stops: refused before the run, with the point's number in the
// scene.
void require_reach(const nb::dict& scene, const plant::PlantParameters& parameters) {
  const plant::ArmPlant arm(parameters.arm);
  const auto position_m =
      nb::cast<nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>>(
          table(scene, "path")["position_m"]);
  for (std::size_t i = 0; i < position_m.shape(0); ++i) {
    const double* x = position_m.data() + 3 * i;
    const std::string name = "path: point " + std::to_string(i);
    (void)arm.joint_angles_rad({x[0], x[1], x[2]}, name.c_str());
  }
  if (parameters.hand_kind != plant::HandKind::scripted) return;
  // No hand gives way between the points: the straight line from one to the next may leave the workspace.
  const plant::TipPath path = read_path(scene);
  for (std::uint32_t tick = 0; tick <= whole(scene, "duration_ticks"); ++tick) {
    const double time_s = tick * kTick_s;
    const std::string name = "path: at " + std::to_string(time_s) + " s";
    (void)arm.joint_angles_rad(path.at(time_s).position_m, name.c_str());
  }
}

// As the scene's hand moves it, or as it was moved in the run of which `recorded` are encoder_count and
// tip_m.
plant::Plant read_moved_plant(const nb::dict& scene, const plant::PlantParameters& parameters) {
  if (!scene.contains("recorded")) {
    require_reach(scene, parameters);
    return {parameters, read_path(scene)};
  }
  const nb::dict recorded = table(scene, "recorded");
  const auto count =
      nb::cast<nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>>(
          recorded["encoder_count"]);
  const auto tip_m =
      nb::cast<nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>>(recorded["tip_m"]);
  plant::RecordedMotion motion;
  for (std::size_t i = 0; i < count.shape(0); ++i)
    motion.encoder_count.push_back({count.data()[3 * i], count.data()[3 * i + 1], count.data()[3 * i + 2]});
  for (std::size_t i = 0; i < tip_m.shape(0); ++i)
    motion.tip_m.push_back({tip_m.data()[3 * i], tip_m.data()[3 * i + 1], tip_m.data()[3 * i + 2]});
  return {parameters, std::move(motion)};
}

}  // namespace

nb::dict run_closed_loop(const nb::dict& scene, int actuator_fd, int sensor_fd, const nb::callable& progress,
                         const std::string& cache_folder) {
  const host::Body body = read_body(scene);
  const host::BodyState start = read_start(scene, body);
  const host::ClosedLoopConfig config = read_closed_loop(scene, body, cache_folder);
  const plant::PlantParameters parameters = read_plant(scene);
  plant::Plant plant = read_moved_plant(scene, parameters);
  const std::unique_ptr<link::MeteredLink> link = link::make_metered_link(read_link(scene));
  host::FileDescriptorPeer board(actuator_fd, sensor_fd);

  host::ClosedLoopResult run;
  {
    const nb::gil_scoped_release no_gil;
    run = host::run_closed_loop(body, start, plant, board, link->down(), link->up(), config,
                                with_gil(progress), link->usb_host());
  }
  nb::dict result;
  add_ticks(result, run.ticks);
  add_updates(result, run.updates);
  add_body(result, body, config.session.friction, run.state_at_peak.position_m, run.peak_tick * kTick_s,
           &run.tip_at_peak_m, run.patch_at_peak);
  if (config.probe_node) {
    result["probe/rendered_m"] =
        columns3<double>(run.probe.ticks, [](const host::ReplayedTick& t) { return t.node_m; });
    result["probe/force_N"] =
        columns3<float>(run.probe.ticks, [](const host::ReplayedTick& t) { return t.force_N; });
    result["probe/correction_energy_J"] =
        column<double>(run.probe.correction_energy_J, [](double energy_J) { return energy_J; });
  }
  result["clock_Hz"] = run.ticks.empty() ? 0u : run.ticks.back().board.clock_Hz;
  add_counters(result, run.counters);
  nb::dict link_counters;
  link_counters["down"] = medium_counters(run.down);
  link_counters["up"] = medium_counters(run.up);
  link_counters["bytes_per_tick"] = link->down().bytes_per_tick();
  link_counters["heard_ticks"] =
      column<std::uint32_t>(run.heard_ticks, [](std::uint32_t tick) { return tick; });
  link_counters["troubles"] = trouble_counters(run.troubles);
  const auto ticks = [](const std::vector<std::uint32_t>& hit) {
    return column<std::uint32_t>(hit, [](std::uint32_t tick) { return tick; });
  };
  link_counters["hit_ticks_down"] = ticks(run.hit_ticks_down);
  link_counters["hit_ticks_up"] = ticks(run.hit_ticks_up);
  link_counters["frames_removed_down"] = run.troubles.frames_removed_down;
  link_counters["frames_removed_up"] = run.troubles.frames_removed_up;
  link_counters["attempts_failed"] = run.down.attempts_failed + run.up.attempts_failed;
  link_counters["bus_offs"] = run.down.bus_offs + run.up.bus_offs;
  link_counters["board_restarts"] = run.counters.board_restarts;
  result["link"] = link_counters;
  result["basis_problem"] = run.bases.problem;
  return result;
}

}  // namespace palpate::python
