#include "host/session/simulation.hpp"

#include <stdexcept>
#include <string>

#include "host/msd/vectors.hpp"
#include "host/session/body_surface.hpp"

namespace palpate::host {
namespace {

constexpr std::uint32_t kTicksPerReport = 20;

void check(const SimulationConfig& config) {
  if (!config.tip_m.empty() && config.tip_m.size() != config.ticks + 1u)
    throw std::invalid_argument("tip path has " + std::to_string(config.tip_m.size()) +
                                " positions: must be " + std::to_string(config.ticks + 1u) +
                                ", one per tick and one for the start");
  if (!config.tip_m.empty() && config.method != Method::semi_implicit_euler)
    throw std::invalid_argument("integrator: a tip needs the semi-implicit integrator");
  if (!config.drives.empty() && config.method != Method::semi_implicit_euler)
    throw std::invalid_argument("integrator: driven nodes need the semi-implicit integrator");
  for (std::size_t i = 0; i < config.export_ticks.size(); ++i)
    if (config.export_ticks[i] > config.ticks ||
        (i > 0 && config.export_ticks[i] <= config.export_ticks[i - 1]))
      throw std::invalid_argument("export tick " + std::to_string(config.export_ticks[i]) +
                                  ": must be greater than the one before and at most " +
                                  std::to_string(config.ticks));
}

class Recorder {
 public:
  Recorder(const SimulationConfig& config, const Progress& progress) : config_(config), progress_(progress) {}

  void at_tick(std::uint32_t tick, const BodyState& state) {
    if (next_ < config_.export_ticks.size() && config_.export_ticks[next_] == tick) {
      result.exported.push_back(state);
      ++next_;
    }
    if (tick % kTicksPerReport == 0 && progress_ && !progress_(tick, config_.ticks))
      throw std::runtime_error("stopped");
  }

  SimulationResult result;

 private:
  const SimulationConfig& config_;
  const Progress& progress_;
  std::size_t next_ = 0;
};

void run_with_tip(const Body& body, const BodyState& start, const SimulationConfig& config,
                  Recorder& recorder) {
  BodySurface surface(body, start, config.step_s, config.surface, config.drives, config.friction);
  ContactState<double> contact;
  SimulationResult& result = recorder.result;
  double peak_N = 0.0;
  recorder.at_tick(0, surface.state());
  for (std::uint32_t tick = 1; tick <= config.ticks; ++tick) {
    const BodyTick done =
        advance_tick(surface, contact, config.law, config.tip_m[tick - 1], config.tip_m[tick]);
    result.mean_force_N.push_back(done.mean_force_N);
    result.mode.push_back(done.contact.mode);
    result.normal.push_back(done.normal);
    result.triangle.push_back(done.contact.mode == ContactMode::free ? 0 : done.contact.triangle);
    if (config.probe_node)
      result.probe_m.push_back(from_eigen(surface.state().position_m.col(*config.probe_node)));
    if (norm(done.mean_force_N) > peak_N) {
      peak_N = norm(done.mean_force_N);
      result.state_at_peak = surface.state();
      result.peak_tick = tick;
    }
    recorder.at_tick(tick, surface.state());
  }
  if (result.peak_tick == 0) {
    result.state_at_peak = surface.state();
    result.peak_tick = config.ticks;
  }
}

// Advance: one step; state: after it.
template <class Advance>
void run_alone(const SimulationConfig& config, const BodyState& state, Recorder& recorder, Advance advance) {
  const int steps = steps_per_tick(config.step_s);
  recorder.at_tick(0, state);
  for (std::uint32_t tick = 1; tick <= config.ticks; ++tick) {
    for (int i = 0; i < steps; ++i) advance();
    recorder.at_tick(tick, state);
  }
  recorder.result.state_at_peak = state;
  recorder.result.peak_tick = config.ticks;
}

}  // namespace

SimulationResult simulate(const Body& body, const BodyState& start, const SimulationConfig& config,
                          const Progress& progress) {
  check(config);
  Recorder recorder(config, progress);
  if (!config.tip_m.empty()) {
    run_with_tip(body, start, config, recorder);
  } else if (!config.drives.empty()) {
    BodySurface surface(body, start, config.step_s, config.surface, config.drives);
    run_alone(config, surface.state(), recorder, [&] { surface.advance(); });
  } else {
    const auto integrator = make_integrator(config.method, body);
    BodyState state = start;
    run_alone(config, state, recorder, [&] { integrator->step(state, {}, config.step_s); });
  }
  return std::move(recorder.result);
}

}  // namespace palpate::host
