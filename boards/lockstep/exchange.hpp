// The one exchange per servo tick between an emulated board and the plant (docs/architecture.md,
// "Lock-step"). In each tick the firmware first reads SensorFrame k, computes, and writes ActuatorFrame k:
// virtual time stands still while the plant computes. Both are plain little-endian structs over a pair of
// byte streams (FIFOs); every payload, the link's bytes included, travels inside them, which is what makes a
// run repeatable to the bit.
//
// The board opens the actuator stream for writing, then the sensor stream for reading. The first tick is 0;
// each ActuatorFrame names the next one. That is mostly tick + 1, but after an overlong tick what the timer
// could not deliver is skipped, so that a tick's number stays its virtual time in ms: the plant advances to
// it, too. A SensorFrame with another number ends the run. With kShutdown the board computes the tick,
// answers with outputs off, and exits (ExitCode).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::lockstep {

inline constexpr std::uint32_t kSensorMagic = 0x314e5350u;    // "PSN1"
inline constexpr std::uint32_t kActuatorMagic = 0x31434150u;  // "PAC1"
// Bytes of the link per tick: 12 Mbaud with 10 bits a byte is 1,200.
inline constexpr std::size_t kLinkBytesPerTick = 2048;

enum SensorFlag : std::uint32_t {
  kEmergencyStop = 1u << 0,  // the e-stop chain is open
  kShutdown = 1u << 1,       // end of the run: the board exits
  kBurnCycles = 1u << 2,     // test input: compute for 2.5 ticks more; no effect where the board has no clock
  kCrash =
      1u << 3,  // test input: run into a processor fault, which ends the run with ExitCode::processor_fault
  // Test input: start again, as after a moment without power. There is no ActuatorFrame for this SensorFrame;
  // the board reads another one next, of its new tick 0.
  kReset = 1u << 4,
  kSupplyLow = 1u << 5,  // of the board's electronics
};

// What the board's process ends with.
enum class ExitCode : int {
  shutdown = 0,         // asked for by kShutdown
  usage = 1,            // wrong command line
  no_channel = 2,       // the streams cannot be opened
  peer_closed = 3,      // a stream ended
  protocol_error = 4,   // wrong magic, tick or length in a SensorFrame
  processor_fault = 5,  // after one last ActuatorFrame with outputs off
};

// Plant to board, at the start of a tick.
struct SensorFrame {
  std::uint32_t magic;
  std::uint32_t tick;
  std::array<std::int32_t, 3> encoder_count;  // joint encoders, see shared/device
  std::array<float, 3> current_A;             // measured motor currents
  std::uint32_t flags;                        // SensorFlag
  std::uint32_t link_length;                  // valid bytes in link
  std::array<std::uint8_t, kLinkBytesPerTick> link;
};

// Board to plant, when the servo tick is computed.
struct ActuatorFrame {
  std::uint32_t magic;
  std::uint32_t tick;
  std::uint32_t next_tick;          // that of the SensorFrame that the board will read next
  std::array<float, 3> setpoint_A;  // motor current set-points; 0 when outputs are off
  std::uint32_t enabled;            // 1: amplifiers enabled
  // Telemetry that does not cross the link: for the record only, never fed back.
  std::array<float, 3> tip_m;
  std::array<float, 3> force_N;  // of the tip on the body, after limits
  std::uint32_t contact_mode;
  std::uint32_t triangle;
  std::array<float, 3> barycentric;
  std::array<float, 3> normal;   // unit outward normal of the contact; zero when free
  std::uint32_t mode;            // palpate.BoardStatus MODE_*
  std::uint32_t faults;          // bits of palpate::firmware::Fault
  std::uint32_t model_sequence;  // of the active model; 0: none
  std::uint32_t model_age_ticks;
  std::uint32_t catch_up_ticks;       // ticks that the shadow model still lags behind; 0: none is catching up
  std::uint32_t missed_deadlines;     // so far
  std::uint32_t background_overruns;  // ticks so far whose background work was not done when the next began
  std::uint32_t tick_count;           // previous servo tick, interrupt entry to exit, in counts of clock_Hz
  std::uint32_t busy_count;           // and the background runs that ended in it, likewise
  std::uint32_t clock_Hz;             // 0 where the board has no such clock
  std::uint32_t link_length;          // valid bytes in link
  std::array<std::uint8_t, kLinkBytesPerTick> link;
};

static_assert(sizeof(SensorFrame) == 40 + kLinkBytesPerTick);
static_assert(sizeof(ActuatorFrame) == 128 + kLinkBytesPerTick);

}  // namespace palpate::lockstep
