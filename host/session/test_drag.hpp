// Pressed 3 mm into a block and dragged over its cells, with models of builder `hybrid`: a closed loop for
// tests.
#pragma once

#include <cstdint>
#include <numbers>
#include <optional>

#include "host/plant/plant.hpp"
#include "host/session/closed_loop_config.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host::test {

inline Body drag_body() {
  LatticeSpec spec = reference_spec(9);
  spec.origin_m = {-0.04, -0.04, -0.10};  // the top at -2 cm
  return make_lattice(spec);
}

inline ClosedLoopConfig drag_config(std::uint32_t ticks, std::uint32_t host_delay_ticks,
                                    const TraceWish& trace) {
  ClosedLoopConfig config;
  config.ticks = ticks;
  config.host_delay_ticks = host_delay_ticks;
  config.trace = trace;
  config.session.friction.elsewhere = {0.3, 0.3};
  config.session.model.builder = Builder::hybrid;
  config.session.model.middle_shift_rad_s = {2.0 * std::numbers::pi * 20.0};
  config.session.model.bases = {BasisTiming::virtual_time, 100, std::nullopt};
  return config;
}

// To `end_x_m` at 1 s, from -2.6 cm.
inline plant::Plant drag_plant(double end_x_m) {
  plant::PlantParameters parameters;
  parameters.hand_kind = plant::HandKind::scripted;
  return {parameters, plant::TipPath::minimum_jerk({{0.1, {-0.026, 0.002, -0.0195}},
                                                    {0.35, {-0.026, 0.002, -0.023}},
                                                    {1.0, {end_x_m, 0.002, -0.023}}})};
}

}  // namespace palpate::host::test
