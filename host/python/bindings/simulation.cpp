#include "host/session/simulation.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "host/msd/vectors.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/progress.hpp"
#include "host/python/bindings/scene.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

// A normal for the record: NaN where there is no contact.
Vec3d or_nan(const Vec3d& normal) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return normal == Vec3d{} ? Vec3d{kNone, kNone, kNone} : normal;
}

}  // namespace

nb::dict simulate(const nb::dict& scene, const nb::callable& progress) {
  const host::Body body = read_body(scene);
  const host::BodyState start = read_start(scene, body);
  host::SimulationConfig config;
  config.method = read_method(scene);
  config.step_s = kTick_s / whole(table(scene, "integrator"), "steps_per_tick");
  config.law = read_contact(scene);
  config.surface = read_surface(scene);
  config.friction = read_friction(scene);
  config.ticks = whole(scene, "duration_ticks");
  config.drives = read_drives(scene, body);
  config.export_ticks = whole_list(table(scene, "outputs"), "node_ticks");
  const bool has_tip = !scene["path"].is_none();
  if (has_tip) {
    const plant::TipPath path = read_path(scene);
    for (std::uint32_t tick = 0; tick <= config.ticks; ++tick)
      config.tip_m.push_back(path.at(tick * kTick_s).position_m);
  }
  host::SimulationResult run;
  {
    const nb::gil_scoped_release no_gil;
    run = host::simulate(body, start, config, with_gil(progress));
  }

  nb::dict result;
  if (has_tip) {
    std::vector<double> time_s;
    for (std::uint32_t tick = 1; tick <= config.ticks; ++tick) time_s.push_back(tick * kTick_s);
    result["tip/time_s"] = array(std::move(time_s));
    const std::vector<Vec3d> tip_m(config.tip_m.begin() + 1, config.tip_m.end());
    result["tip/position_m"] = columns3<double>(tip_m, [](const Vec3d& x) { return x; });
    result["tip/force_N"] = columns3<double>(run.mean_force_N, [](const Vec3d& f) { return f; });
    result["tip/contact_mode"] = column<std::uint8_t>(run.mode, [](ContactMode m) { return m; });
    result["tip/normal"] = columns3<double>(run.normal, or_nan);
    result["tip/triangle"] = column<std::uint32_t>(run.triangle, [](std::uint32_t t) { return t; });
  }
  std::vector<double> export_time_s;
  export_time_s.reserve(config.export_ticks.size());
  for (const std::uint32_t tick : config.export_ticks) export_time_s.push_back(tick * kTick_s);
  result["nodes/time_s"] = array(std::move(export_time_s));
  const auto nodes = static_cast<std::size_t>(body.node_count());
  result["nodes/position_m"] = stacked(run.exported, false, nodes);
  result["nodes/velocity_m_s"] = stacked(run.exported, true, nodes);
  add_body(result, body, config.friction, run.state_at_peak.position_m, run.peak_tick * kTick_s,
           has_tip ? &config.tip_m[run.peak_tick] : nullptr, {});
  return result;
}

nb::dict reference(const nb::dict& scene, const Times& time_s, const Positions& tip_m,
                   const nb::callable& progress) {
  const host::Body body = read_body(scene);
  const host::BodyState start = read_start(scene, body);
  host::SimulationConfig config;
  config.step_s = kTick_s / whole(table(scene, "reference"), "steps_per_tick");
  config.law = read_contact(scene);
  config.surface = read_surface(scene);
  config.drives = read_drives(scene, body);
  config.friction = read_friction(scene);
  config.probe_node = read_probe_node(scene, body);
  // Rows may skip ticks that the board lost: the tip goes straight between them, as the board's own history
  // has it.
  const std::size_t rows = time_s.shape(0);
  if (tip_m.shape(0) != rows || rows == 0)
    throw std::invalid_argument("reference: time_s and tip_m must have the same number of rows, at least 1");
  const auto tip = [&](std::size_t row) {
    const double* x = tip_m.data() + 3 * row;
    return Vec3d{x[0], x[1], x[2]};
  };
  std::vector<std::uint32_t> tick_of_row{0};
  config.tip_m.push_back(tip(0));
  for (std::size_t row = 1; row < rows; ++row) {
    const long elapsed = std::lround((time_s.data()[row] - time_s.data()[row - 1]) / kTick_s);
    if (elapsed < 1) throw std::invalid_argument("reference: time_s must increase by at least a servo tick");
    for (long i = 1; i <= elapsed; ++i)
      config.tip_m.push_back(tip(row - 1) + (tip(row) - tip(row - 1)) *
                                                (static_cast<double>(i) / static_cast<double>(elapsed)));
    tick_of_row.push_back(tick_of_row.back() + static_cast<std::uint32_t>(elapsed));
  }
  config.ticks = tick_of_row.back();
  host::SimulationResult run;
  {
    const nb::gil_scoped_release no_gil;
    run = host::simulate(body, start, config, with_gil(progress));
  }

  // The first row is where the path starts: no step leads there.
  nb::dict result;
  result["reference/force_N"] = columns3<double>(
      tick_of_row, [&](std::uint32_t tick) { return tick == 0 ? Vec3d{} : run.mean_force_N[tick - 1]; });
  result["reference/contact_mode"] = column<std::uint8_t>(
      tick_of_row, [&](std::uint32_t tick) { return tick == 0 ? ContactMode::free : run.mode[tick - 1]; });
  result["reference/normal"] = columns3<double>(
      tick_of_row, [&](std::uint32_t tick) { return or_nan(tick == 0 ? Vec3d{} : run.normal[tick - 1]); });
  if (config.probe_node) {
    const Vec3d start_m = host::from_eigen(start.position_m.col(*config.probe_node));
    result["probe/reference_m"] = columns3<double>(
        tick_of_row, [&](std::uint32_t tick) { return tick == 0 ? start_m : run.probe_m[tick - 1]; });
  }
  return result;
}

}  // namespace palpate::python
