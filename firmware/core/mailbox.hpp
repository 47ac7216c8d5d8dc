// What crosses between the servo interrupt and the background, apart from models and trace (renderer.hpp,
// servo.hpp).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "firmware/core/supervisor.hpp"
#include "firmware/core/tuning.hpp"
#include "firmware/ports/spsc_ring.hpp"

namespace palpate::firmware {

inline constexpr std::uint16_t kNoNode = 0xffff;     // no node has this number (shared/wire/ports.hpp)
inline constexpr std::uint16_t kManyNodes = 0xfffe;  // models of several

// Who asked: travels with a command and comes back with its reply.
struct Requester {
  std::uint16_t node = 0;
  std::uint64_t transfer_id = 0;
};

struct CommandRequest {
  Command command{};
  Requester requester{};
};

struct CommandReply {
  CommandOutcome outcome{};
  Mode mode = Mode::boot;  // after the command
  Requester requester{};
};

// The interrupt's part of palpate.BoardStatus, all of one tick.
struct StatusSnapshot {
  std::uint32_t tick = 0;
  Mode mode = Mode::boot;
  FaultSet faults = 0;
  std::uint32_t token = 0;
  std::uint32_t missed_deadlines = 0;
  std::uint32_t worst_tick_count = 0;
};

// A tick of the board as a plain device: palpate.DeviceState.
struct DeviceSample {
  std::uint32_t tick = 0;
  Vec3f tip_m{};         // device frame
  Vec3f velocity_m_s{};  // of the tip
  Vec3f force_N{};       // of the tip on the body, after limits
  Mode mode = Mode::boot;
  std::uint8_t flags = 0;
  FaultSet faults = 0;
};

// What `palpate calibrate` looks at, of one tick: the register arm.sample, and the encoders' own counts.
struct ArmSample {
  std::uint32_t tick = 0;
  std::array<std::int32_t, 3> encoder_count{};  // as the encoders have them
  JointValues joint_rad{};
  JointValues joint_rad_s{};         // estimated between counts
  JointValues setpoint_A{};          // that are asked for in this tick; zeros while outputs are off
  JointValues measured_current_A{};  // at its beginning
};

// How a new tuning comes into use. The background asks; the interrupt, which alone knows that nothing is
// armed, agrees, and obeys nothing that could arm until the background has stored the tuning or given up.
enum class TuningStep : std::uint8_t {
  idle,     // background's turn
  asked,    // interrupt's
  refused,  // background's: armed, or a calibration goes on
  agreed,   // background's
  commit,   // interrupt's: Mailbox::tuning is to be used
  done,     // background's
};

struct Mailbox {
  SpscRing<CommandRequest, 4> commands;  // background to interrupt, which runs one a tick
  // STOP and DISARM so far, which pass by that ring: whoever fills it cannot hold them up. Written by the
  // background; then by the interrupt, how many of both it has obeyed, and its mode after that.
  std::atomic<std::uint32_t> stops{0};
  std::atomic<std::uint32_t> disarms{0};
  std::atomic<std::uint32_t> urgent_done{0};
  std::atomic<Mode> urgent_mode{Mode::boot};
  SpscRing<CommandReply, 8> replies;   // interrupt to background
  SpscRing<StatusSnapshot, 8> status;  // interrupt to background
  SpscRing<Vec3f, 4>
      direct_forces;  // background to interrupt, which takes the newest: as palpate.DirectForce
  SpscRing<DeviceSample, 2> device;                       // interrupt to background, while it is wanted
  std::atomic<bool> device_wanted{false};                 // written by the background
  SpscRing<ArmSample, 1> samples;                         // interrupt to background, while they are wanted
  std::atomic<bool> samples_wanted{false};                // written by the background
  std::atomic<TuningStep> tuning_step{TuningStep::idle};  // written by whose turn it is
  Tuning tuning{};                                        // written by the background, at idle and agreed
  // Written by the interrupt: who armed last, and whether that still holds (rendering, or suspended).
  std::atomic<std::uint16_t> armed_node{kNoNode};
  std::atomic<bool> is_armed{false};
  // Written by the background: frames of that node so far, and whose models the renderer has.
  std::atomic<std::uint32_t> host_frames{0};
  std::atomic<std::uint16_t> model_node{kNoNode};
};

}  // namespace palpate::firmware
