// The whole system in virtual time: arm and hand, the board behind its lock-step exchange, a metered link,
// the session.
//
// One servo tick: the board reads encoders and the bytes that the link has brought, computes, and hands back
// set-points and its own bytes; the plant lets the millisecond pass; what has arrived at the host is taken by
// the session, which answers after its computing delay. Nothing here looks at the wall clock: equal scenes
// give equal records.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "boards/lockstep/exchange.hpp"
#include "firmware/core/renderer.hpp"
#include "host/link/fault_plan.hpp"
#include "host/link/medium.hpp"
#include "host/plant/plant.hpp"
#include "host/session/node_probe.hpp"
#include "host/session/session.hpp"
#include "host/session/simulation.hpp"
#include "host/session/trace_choice.hpp"

namespace palpate::host {

// A board at the other end of two byte streams (boards/lockstep/exchange.hpp).
class LockstepPeer {
 public:
  virtual ~LockstepPeer() = default;
  // Throws std::runtime_error when the board is gone or speaks another protocol.
  virtual void send(const lockstep::SensorFrame& frame) = 0;
  virtual void receive(lockstep::ActuatorFrame& frame) = 0;
};

// Over two blocking file descriptors, which stay the caller's.
class FileDescriptorPeer final : public LockstepPeer {
 public:
  FileDescriptorPeer(int actuator_fd, int sensor_fd) : actuator_fd_(actuator_fd), sensor_fd_(sensor_fd) {}
  void send(const lockstep::SensorFrame& frame) override;
  void receive(lockstep::ActuatorFrame& frame) override;

 private:
  int actuator_fd_, sensor_fd_;
};

struct GripChange {
  std::uint32_t tick = 0;
  double grip = 1.0;
};

struct ClosedLoopConfig {
  std::uint32_t ticks = 0;
  std::uint32_t host_delay_ticks = 0;  // from the tick in which a model is due to its hand-over to the link
  std::uint32_t models_under_way = 1;  // that the host may compute at a time
  TraceWish trace{};                   // what the board is asked to send of its ticks
  firmware::CatchUpPolicy catch_up_policy = firmware::kCatchUpCortexM4;  // the board's
  SessionConfig session{};
  std::vector<GripChange> grip_changes;  // increasing ticks
  std::optional<int> probe_node;         // whose rendered positions are wanted
  // Test inputs.
  std::vector<std::uint32_t> overlong_ticks, emergency_stop_ticks;
  std::vector<link::Fault> faults_down, faults_up;  // on the link, to the board and to the host
};

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
  std::uint64_t frames_repeated_up = 0;  // right behind themselves: ignored
  std::uint32_t models_sent = 0, models_taken = 0, models_refused = 0;
  std::uint64_t basis_waits = 0;  // Session::basis_waits
};

struct ClosedLoopResult {
  std::vector<LoopTick> ticks;
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
};

// Runs `config.ticks` servo ticks and shuts the board down. `down` carries bytes to the board, `up` to the
// host. Throws what plant, session and peer throw; std::runtime_error("stopped") when progress says so;
// std::invalid_argument for Feedback::paper without full traces.
ClosedLoopResult run_closed_loop(const Body& body, const BodyState& start, plant::Plant& plant,
                                 LockstepPeer& board, link::Medium& down, link::Medium& up,
                                 const ClosedLoopConfig& config, const Progress& progress);

}  // namespace palpate::host
