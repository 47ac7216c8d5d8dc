// What the board rendered, found again after the run: where a node of the body was in its models, and the
// energy of its corrections.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "shared/math/linear.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::host {

// A local model that was sent, as far as it takes to render it again.
struct SentModel {
  wire::PackedModel model;
  std::vector<int> nodes;  // of the model, the body's own numbers
};

// One servo tick as the board computed it.
struct RenderedTick {
  std::uint32_t tick = 0;
  Vec3f tip_m{};
  std::uint32_t model_sequence = 0;  // that was rendered; 0: none
};

// What a replay yields in a tick.
struct ReplayedTick {
  Vec3d node_m{};   // device frame; NaN where no model was rendered that holds the node
  Vec3f force_N{};  // of the tip on the body, before the board's limits
};

struct Replay {
  std::vector<ReplayedTick> ticks;  // one per tick
  // One per model: its correction energy (firmware/core/renderer.hpp), summed in double precision; NaN where
  // it was never rendered. A board that forgets its models in between (Renderer::isr_reset) begins anew,
  // which is not known here.
  std::vector<double> correction_energy_J;
};

// Renders every model again with the board's code, from its own tick to the last one in which it was active
// (model_replay.hpp). ticks: in order; numbers may be missing (lost ticks: the board then takes the tip of
// the next one). models: in the order in which they were sent. catch_up_policy: the board's.
Replay replay_models(std::span<const RenderedTick> ticks, std::span<const SentModel> models, int node,
                     const firmware::CatchUpPolicy& catch_up_policy);

}  // namespace palpate::host
