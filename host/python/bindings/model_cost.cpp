#include "host/bench/model_cost.hpp"

#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/scene.hpp"
#include "host/session/simulation.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

constexpr std::uint32_t kPeriodTicks = 33;  // 30 updates a second

// The body 30 times a second, as long as the scripted tip touches it.
std::vector<host::bench::TouchedState> touched_states(const nb::dict& scene, const host::Body& body,
                                                      const host::ClosedLoopConfig& loop) {
  const plant::TipPath path = read_path(scene);
  host::SimulationConfig config;
  config.step_s = loop.session.step_s;
  config.law = loop.session.law;
  config.surface = loop.session.surface;
  config.friction = loop.session.friction;
  config.ticks = loop.ticks;
  for (std::uint32_t tick = 0; tick <= config.ticks; ++tick)
    config.tip_m.push_back(path.at(tick * kTick_s).position_m);
  for (std::uint32_t tick = kPeriodTicks; tick <= config.ticks; tick += kPeriodTicks)
    config.export_ticks.push_back(tick);
  const host::SimulationResult run = host::simulate(body, read_start(scene, body), config, {});
  std::vector<host::bench::TouchedState> states;
  for (std::size_t i = 0; i < config.export_ticks.size(); ++i) {
    const std::uint32_t tick = config.export_ticks[i];
    if (run.mode[tick - 1] == ContactMode::free) continue;
    const Vec3d& tip = config.tip_m[tick];
    const host::SurfacePoint contact = host::nearest_surface_point(body, run.exported[i].position_m,
                                                                   Eigen::Vector3d(tip[0], tip[1], tip[2]));
    states.push_back({run.exported[i], contact});
  }
  return states;
}

}  // namespace

nb::dict model_cost(const nb::dict& scene, std::uint32_t rounds) {
  const host::Body body = read_body(scene);
  host::ClosedLoopConfig loop = read_closed_loop(scene, body, "");
  loop.session.model.bases = {};  // each is computed, and waited for
  const std::vector<host::bench::TouchedState> states = touched_states(scene, body, loop);
  host::bench::ModelCost cost;
  {
    const nb::gil_scoped_release no_gil;
    const auto builder = host::make_builder(body, loop.session.model, kTick_s);
    cost = host::bench::measure_model_cost(*builder, states, rounds);
  }
  nb::dict result;
  result["kernel_s"] = cost.kernel_s;
  result["model_s"] = cost.model_s;
  result["first_s"] = cost.first_s;
  return result;
}

}  // namespace palpate::python
