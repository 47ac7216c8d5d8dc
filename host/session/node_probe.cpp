#include "host/session/node_probe.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "host/session/model_replay.hpp"

namespace palpate::host {
namespace {

// First of the ticks from this number on: where the tip of a lost tick is taken from.
std::size_t row_from(std::span<const RenderedTick> ticks, std::uint32_t tick, std::uint32_t sequence) {
  const auto found =
      std::lower_bound(ticks.begin(), ticks.end(), tick,
                       [](const RenderedTick& t, std::uint32_t wanted) { return t.tick < wanted; });
  if (found == ticks.end())
    throw std::invalid_argument("probe: local model " + std::to_string(sequence) + " needs tick " +
                                std::to_string(tick) + ", which lies beyond the ticks that were recorded");
  return static_cast<std::size_t>(found - ticks.begin());
}

std::optional<std::size_t> surface_index(const SentModel& model, int node) {
  const auto found = std::find(model.nodes.begin(), model.nodes.end(), node);
  if (found == model.nodes.end()) return std::nullopt;
  return static_cast<std::size_t>(found - model.nodes.begin());
}

}  // namespace

std::vector<ReplayedTick> replay_models(std::span<const RenderedTick> ticks,
                                        std::span<const SentModel> models, int node) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ReplayedTick> result(ticks.size(), {{kNone, kNone, kNone}, {}});
  for (const SentModel& model : models) {
    const palpate_ModelState_1_0& state = model.model.state;
    const auto active = std::find_if(ticks.begin(), ticks.end(), [&](const RenderedTick& t) {
      return t.model_sequence == state.sequence;
    });
    if (active == ticks.end()) continue;  // refused, superseded, or too late
    const auto index = surface_index(model, node);
    // Other kinds begin when they are taken over, with the tip of the tick before.
    const bool rolled = state.kind == palpate_ModelState_1_0_KIND_MODES;
    const std::uint32_t start = rolled ? state.tick : active->tick - 1;
    ModelReplay replay(model.model, ticks[row_from(ticks, start, state.sequence)].tip_m, start);
    // In the background every tick is replayed, with the tip of the next one where a tick was lost; from the
    // swap on the interrupt steps once for each tick that it had.
    for (std::uint32_t tick = start + 1; tick < active->tick; ++tick)
      (void)replay.step(ticks[row_from(ticks, tick, state.sequence)].tip_m);
    for (auto row = static_cast<std::size_t>(active - ticks.begin()); row < ticks.size(); ++row) {
      if (ticks[row].model_sequence != state.sequence) break;
      result[row].force_N = replay.step(ticks[row].tip_m).force_N;
      if (index) {
        const Eigen::Vector3d x = replay.surface_node_m(*index);
        result[row].node_m = {x.x(), x.y(), x.z()};
      }
    }
  }
  return result;
}

}  // namespace palpate::host
