// What a local model costs the host, by builder: the 12 x 12 x 12 body of the demo with a node of its top
// pressed 5 mm in, in JSON. All builders take turns in one run; the ratio to the patch's is what counts.
// Before each model the body itself is stepped for a servo tick, as a session does: what the caches hold is
// the body.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/linearize/pressed_state.hpp"
#include "host/msd/lattice.hpp"
#include "host/msd/semi_implicit_euler.hpp"

namespace {

using namespace palpate::host;

constexpr int kRounds = 40;
constexpr int kStepsPerTick = 10;
constexpr double kTick_s = 1e-3, kStep_s = kTick_s / kStepsPerTick, kPress_m = 0.005;

Body demo_body() {
  LatticeSpec spec;
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus, Face::x_minus};
  return make_lattice(spec);
}

struct Candidate {
  std::string name;
  std::unique_ptr<ModelBuilder> builder;
  Eigen::Index modes = 0;
  double first_s = 0;  // with what is computed once for a patch
  std::vector<double> time_s;
};

double seconds_of(ModelBuilder& builder, const BodyState& state, const SurfacePoint& contact,
                  Eigen::Index& modes) {
  const auto start = std::chrono::steady_clock::now();
  const LocalModel model = builder.build(state, contact, {});
  modes = model.modes();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

int main() {
  const Body body = demo_body();
  const LatticeShape& lattice = *body.lattice();
  const int node = lattice.node(5, 5, lattice.nodes[2] - 1);
  const BodyState state = pressed_state(body, node, {0, 0, -kPress_m}, kStep_s);
  const SurfacePoint contact = nearest_surface_point(body, state.position_m, state.position_m.col(node));

  std::vector<Candidate> candidates;
  const auto add = [&](std::string name, const BuilderConfig& config) {
    candidates.push_back({std::move(name), make_builder(body, config, kTick_s), 0, 0, {}});
  };
  const double slow_rad_s = 2.0 * std::numbers::pi * 20.0;
  add("patch 4x4x2", {});
  add("krylov, rest, 0 Hz", {Builder::krylov, {}, TangentAt::rest, {0.0}});
  add("krylov, rest, 0 and 20 Hz", {Builder::krylov, {}, TangentAt::rest, {0.0, slow_rad_s}});
  add("krylov, frame, 0 Hz", {Builder::krylov, {}, TangentAt::frame, {0.0}});
  add("krylov, frame, 0 and 20 Hz", {Builder::krylov, {}, TangentAt::frame, {0.0, slow_rad_s}});
  for (Candidate& c : candidates) c.first_s = seconds_of(*c.builder, state, contact, c.modes);
  SemiImplicitEuler integrator(body);
  BodyState moving = state;
  for (int round = 0; round < kRounds; ++round) {
    for (Candidate& c : candidates) {
      for (int i = 0; i < kStepsPerTick; ++i) integrator.step(moving, {}, kStep_s);
      c.time_s.push_back(seconds_of(*c.builder, state, contact, c.modes));
    }
  }

  std::printf("{\"rounds\": %d, \"builders\": [", kRounds);
  double patch_s = 0;
  for (Candidate& c : candidates) {
    std::nth_element(c.time_s.begin(), c.time_s.begin() + kRounds / 2, c.time_s.end());
    const double median_s = c.time_s[kRounds / 2];
    const bool first = &c == candidates.data();
    if (first) patch_s = median_s;
    std::printf(
        "%s\n  {\"builder\": \"%s\", \"modes\": %d, \"first_s\": %.3g, \"median_s\": %.3g, "
        "\"ratio_to_patch\": %.3g}",
        first ? "" : ",", c.name.c_str(), static_cast<int>(c.modes), c.first_s, median_s, median_s / patch_s);
  }
  std::printf("\n]}\n");
}
