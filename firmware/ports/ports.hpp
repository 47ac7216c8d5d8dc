// What a board must provide. The firmware above knows nothing else of the hardware; each port is a C++20
// concept, and a board is one object that fulfils them all.
//
// Contexts. "Interrupt" is the servo tick: the highest priority, nothing on the board delays it. "Background"
// is the main loop, which the interrupt may interrupt anywhere. A function prefixed isr_ is called from the
// interrupt only, every other from the background only. No function may block, allocate, or take longer than
// it must.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/ports/spsc_ring.hpp"
#include "shared/math/linear.hpp"

namespace palpate::firmware {

inline constexpr std::uint32_t kServoRate_Hz = 1000;

// Permission to switch the amplifiers on. Only Outputs (firmware/core/outputs.hpp) can make one, so no other
// code can call a board's isr_enable_amplifiers().
class EnableKey {
  template <class Board>
  friend class Outputs;
  EnableKey() = default;
};

// Joint encoders.
template <class B>
concept EncoderPort = requires(B& board) {
  // Counts of the three joint encoders as latched by isr_begin_tick(); signs and scale as in shared/device.
  { board.isr_encoder_counts() } -> std::same_as<std::array<std::int32_t, 3>>;
};

// Motor current amplifiers. After reset they are disabled with set-points of zero.
template <class B>
concept AmplifierPort = requires(B& board, const std::array<float, 3>& setpoint_A, EnableKey key) {
  // Set-points; they take effect while the amplifiers are enabled.
  { board.isr_set_currents(setpoint_A) } -> std::same_as<void>;
  // Idempotent: called in every tick in which the outputs are to be on.
  { board.isr_enable_amplifiers(key) } -> std::same_as<void>;
  // Idempotent, must not fail: called in every tick in which the outputs are to be off.
  { board.isr_disable_amplifiers() } -> std::same_as<void>;
  // Measured motor currents as latched by isr_begin_tick().
  { board.isr_measured_currents_A() } -> std::same_as<std::array<float, 3>>;
};

// The emergency-stop chain as latched by isr_begin_tick(): true when it is open, which must include a broken
// wire.
template <class B>
concept EmergencyStopPort = requires(B& board) {
  { board.isr_emergency_stop_open() } -> std::same_as<bool>;
};

// The supply of the board's own electronics as latched by isr_begin_tick(): true when it is too low for what
// set-points and monitors mean, or is not watched.
template <class B>
concept SupplyPort = requires(B& board) {
  { board.isr_supply_low() } -> std::same_as<bool>;
};

// A counter that runs freely upwards and wraps modulo 2^32, in step with the timer that raises the servo
// interrupt.
template <class B>
concept ClockPort = requires(const B& board) {
  // Any context.
  { board.clock_count() } -> std::same_as<std::uint32_t>;
  // Constant, a multiple of kServoRate_Hz; 0 on a board without such a counter: then no deadline can be
  // missed.
  { board.clock_Hz() } -> std::same_as<std::uint32_t>;
  // Count at which the first servo interrupt was due: to within a tenth of a tick, and not too late.
  // Interrupt context.
  { board.first_due_count() } -> std::same_as<std::uint32_t>;
};

// The byte link to the host: two rings, and a hint. The board's driver produces into `received` and consumes
// from `transmit`; the firmware's background does the opposite. Bytes that do not fit in `received` are the
// driver's to drop: the framing above notices.
#ifndef PALPATE_LINK_RECEIVE_BYTES
#define PALPATE_LINK_RECEIVE_BYTES 4096
#endif
// 4,096 are two ticks of 12 Mbaud.
inline constexpr std::uint32_t kLinkReceiveCapacity = PALPATE_LINK_RECEIVE_BYTES;
#ifndef PALPATE_LINK_TRANSMIT_BYTES
#define PALPATE_LINK_TRANSMIT_BYTES 4096
#endif
// 4,096 are about 25 traces of 4 ticks.
inline constexpr std::uint32_t kLinkTransmitCapacity = PALPATE_LINK_TRANSMIT_BYTES;
struct LinkBuffers {
  SpscRing<std::uint8_t, kLinkReceiveCapacity> received;
  SpscRing<std::uint8_t, kLinkTransmitCapacity> transmit;
  // Frames that the driver has taken from `transmit` for nobody. Background's own.
  std::uint32_t frames_unsent = 0;
};
template <class B>
concept LinkPort = requires(B& board) {
  { board.link() } -> std::same_as<LinkBuffers&>;
  // The firmware is about to look at `received`: a driver that no interrupt feeds moves what has come.
  { board.poll_receive() } -> std::same_as<void>;
  // There may be something new to transmit: a driver that is fed by interrupts starts itself here.
  { board.start_transmit() } -> std::same_as<void>;
};

// A few bytes that the board keeps (core/tuning.hpp). Background context, amplifiers off; reading also before
// the first tick.
template <class B>
concept ParameterPort = requires(B& board, std::span<std::uint8_t> out, std::span<const std::uint8_t> in) {
  // Constant: do they survive a loss of power?
  { board.keeps_parameters() } -> std::same_as<bool>;
  // False, and `out` is of no use: nothing of this length has been written.
  { board.read_parameters(out) } -> std::same_as<bool>;
  // May take some 50 ms. False: what was there before is there still.
  { board.write_parameters(in) } -> std::same_as<bool>;
};

// Why the firmware runs again, by the board: causes of the last reset as the part says them, and the record
// of the fault before it (on a Cortex-M boards/cortex_m/fault_record.hpp), zeros where there was none.
// Register reset.record.
struct ResetReport {
  bool is_known = false;  // false: the board cannot tell, and has no such register
  std::uint32_t causes = 0;
  std::uint32_t reason = 0, detail = 0;
  std::uint32_t program_counter = 0, cfsr = 0, hfsr = 0, bfar = 0;
  std::uint32_t failed_starts = 0;
};

// What survives a reset.
template <class B>
concept ResetPort = requires(B& board) {
  // Background, before the first tick.
  { board.reset_report() } -> std::same_as<ResetReport>;
  // Words that no reset changes but one by loss of power (core/kept_tick.hpp): as many as that asks for, or
  // none. Before the first tick, then interrupt context.
  { board.kept_words() } -> std::same_as<std::span<std::uint32_t>>;
};

// Of a board that keeps nothing: what is written holds until the firmware ends, and nobody knows what was
// before.
struct KeepsNothing {
  [[nodiscard]] static constexpr bool keeps_parameters() { return false; }
  [[nodiscard]] static constexpr bool read_parameters(std::span<std::uint8_t>) { return false; }
  [[nodiscard]] static constexpr bool write_parameters(std::span<const std::uint8_t>) { return true; }
  [[nodiscard]] static constexpr ResetReport reset_report() { return {}; }
  [[nodiscard]] static constexpr std::span<std::uint32_t> kept_words() { return {}; }
};

// What the firmware did in a tick, for boards that record it (the emulated ones). It is never fed back.
struct TickReport {
  std::uint32_t tick = 0;
  std::uint32_t next_tick = 0;
  Vec3f tip_m{};    // device frame
  Vec3f force_N{};  // of the tip on the body, after limits
  std::uint32_t contact_mode = 0;
  std::uint32_t triangle = 0;
  Vec3f barycentric{};
  Vec3f normal{};            // unit outward normal of the contact; zero when free
  std::uint32_t mode = 0;    // Mode
  std::uint32_t faults = 0;  // bits of Fault
  std::uint32_t model_sequence = 0;
  std::uint32_t model_age_ticks = 0;
  std::uint32_t catch_up_ticks = 0;
  std::uint32_t missed_deadlines = 0;
  std::uint32_t background_overruns = 0;
  std::uint32_t tick_count = 0;
  std::uint32_t busy_count = 0;
  std::uint32_t clock_Hz = 0;
};

// Start and end of a servo tick.
template <class B>
concept TickPort = requires(B& board, const TickReport& report, std::uint32_t tick) {
  // First thing in the interrupt: latches encoders, currents, emergency stop and supply for this tick.
  { board.isr_begin_tick(tick) } -> std::same_as<void>;
  // Last thing in the interrupt, after the outputs are set.
  { board.isr_end_tick(report) } -> std::same_as<void>;
};

template <class B>
concept BoardPort = EncoderPort<B> && AmplifierPort<B> && EmergencyStopPort<B> && SupplyPort<B> &&
    ClockPort<B> && LinkPort<B> && TickPort<B> && ParameterPort<B> && ResetPort<B>;

// What the board calls itself: texts of at most 32 bytes (palpate.GetInfo), the first fit for a node's name.
struct BoardIdentity {
  std::string_view board;
  std::string_view firmware;               // MAJOR.MINOR.PATCH
  std::array<std::uint8_t, 16> unique_id;  // of the chip: no other has it, and it is not all zero
};

}  // namespace palpate::firmware
