#include "host/session/node_probe.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "host/msd/vectors.hpp"
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

// Sums what forces change, each until the tip's next place.
class CorrectionAccount {
 public:
  explicit CorrectionAccount(const Vec3f& tip_m) : tip_m_(widen(tip_m)) {}
  void move(const Vec3f& tip_m) {
    const Vec3d next_m = widen(tip_m);
    energy_J_ += dot(change_N_, next_m - tip_m_);
    tip_m_ = next_m;
    change_N_ = {};
  }
  void change(const Vec3f& replayed_N, const Vec3f& rendered_N) {
    change_N_ = widen(replayed_N) - widen(rendered_N);
  }
  [[nodiscard]] double energy_J() const { return energy_J_; }

 private:
  Vec3d tip_m_, change_N_{};
  double energy_J_ = 0.0;
};

}  // namespace

Replay replay_models(std::span<const RenderedTick> ticks, std::span<const SentModel> models, int node,
                     const firmware::CatchUpPolicy& catch_up_policy) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Replay result{std::vector<ReplayedTick>(ticks.size(), {{kNone, kNone, kNone}, {}}),
                std::vector<double>(models.size(), kNone)};
  std::uint32_t account_from = 0;  // ticks before are accounted in a model before
  for (std::size_t m = 0; m < models.size(); ++m) {
    const SentModel& model = models[m];
    const palpate_ModelState_1_0& state = model.model.state;
    const auto active = std::find_if(ticks.begin(), ticks.end(), [&](const RenderedTick& t) {
      return t.model_sequence == state.sequence;
    });
    if (active == ticks.end()) continue;  // refused, superseded, or too late
    const auto index = surface_index(model, node);
    // Other kinds begin when they are taken over, with the tip of the tick before.
    const bool rolled = state.kind == palpate_ModelState_1_0_KIND_MODES;
    const std::uint32_t start = rolled ? state.tick : active->tick - 1;
    const Vec3f start_m = ticks[row_from(ticks, start, state.sequence)].tip_m;
    ModelReplay replay(model.model, start_m, start);
    CorrectionAccount account(start_m);
    replay.set_near_period(catch_up_policy.near_period_steps);
    // In the background every tick is replayed, with the tip of the next one where a tick was lost; from the
    // swap on the interrupt steps once for each tick that it had.
    for (std::uint32_t tick = start + 1; tick < active->tick; ++tick) {
      const std::size_t row = row_from(ticks, tick, state.sequence);
      account.move(ticks[row].tip_m);
      const Vec3f force_N = replay.step(ticks[row].tip_m).force_N;
      if (tick >= account_from) account.change(force_N, result.ticks[row].force_N);
    }
    replay.set_near_period(kNearPeriod_steps);
    account.move(active->tip_m);
    result.correction_energy_J[m] = account.energy_J();
    account_from = active->tick;
    for (auto row = static_cast<std::size_t>(active - ticks.begin()); row < ticks.size(); ++row) {
      if (ticks[row].model_sequence != state.sequence) break;
      result.ticks[row].force_N = replay.step(ticks[row].tip_m).force_N;
      if (index) {
        const Eigen::Vector3d x = replay.surface_node_m(*index);
        result.ticks[row].node_m = {x.x(), x.y(), x.z()};
      }
    }
  }
  return result;
}

}  // namespace palpate::host
