// What a closed loop leaves behind: its ticks, what became of its local models, and where the body was.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "boards/lockstep/exchange.hpp"
#include "host/linearize/basis_store.hpp"
#include "host/link/medium.hpp"
#include "host/msd/body.hpp"
#include "host/session/node_probe.hpp"
#include "host/session/trouble_counters.hpp"
#include "shared/math/linear.hpp"

namespace palpate::host {

// One servo tick, as given to the board and as it answered.
struct LoopTick {
  std::uint32_t tick = 0;
  std::array<std::int32_t, 3> encoder_count{};
  std::array<float, 3> measured_current_A{};
  lockstep::ActuatorFrame board{};  // link bytes included
  Vec3d true_tip_m{}, hand_target_m{}, hand_force_N{};
  std::uint32_t link_up_bytes = 0, link_down_bytes = 0;
};

// What became of one local model.
struct UpdateRecord {
  static constexpr std::uint8_t kNeverHeard = 255;
  std::uint32_t sequence = 0, tick = 0, sent_tick = 0, swap_tick = 0;
  std::uint8_t status = kNeverHeard;  // palpate::Status, from the board
  std::uint16_t modes = 0;
  std::uint8_t nodes = 0;
  std::uint32_t bytes = 0;           // frame of the state
  std::uint32_t basis_bytes = 0;     // frames of bases since the state before
  float correction_energy_J = 0.0f;  // from the board (firmware/core/renderer.hpp)
  std::uint32_t interpolated_ticks = 0;
  double interpolation_error_m = 0.0;
  double damping_coupling = 0.0;  // what the modal form neglects (host/linearize/modal_reduction.hpp)
  int limited_modes = 0;          // that would grow too fast (host/linearize/growth_limit.hpp)
};

struct LoopCounters {
  std::uint64_t frames_lost_down = 0, frames_lost_up = 0;
  std::uint64_t frames_repeated_up = 0, frames_late_up = 0;  // came again: ignored; behind later ones
  std::uint32_t models_sent = 0, models_taken = 0, models_refused = 0;
  std::uint64_t basis_waits = 0;     // Session::basis_waits
  std::uint32_t board_restarts = 0;  // ClosedLoop::board_restarts
};

struct ClosedLoopResult {
  static constexpr std::uint32_t kNeverHeard = 0xFFFFFFFF;
  std::vector<LoopTick> ticks;
  std::vector<std::uint32_t> heard_ticks;  // of each of them, in which one the host had its tip
  std::vector<UpdateRecord> updates;
  LoopCounters counters;
  Replay probe;  // of all ticks and updates; empty without a probe
  // The session's body when the force of the tip was largest at an update, else at the end.
  BodyState state_at_peak;
  std::uint32_t peak_tick = 0;
  Vec3d tip_at_peak_m{};
  std::vector<int> patch_at_peak;
  // Depends on the files that there were before, unlike all else.
  BasisCounts bases;
  link::MediumCounters down{}, up{};                        // of the link
  TroubleCounters troubles{};                               // what the faults that a scene asks for have done
  std::vector<std::uint32_t> hit_ticks_down, hit_ticks_up;  // in which one hit
};

}  // namespace palpate::host
