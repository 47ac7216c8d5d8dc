// The firmware on a board: the servo tick in its interrupt, everything else in the background.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "firmware/core/deadline_monitor.hpp"
#include "firmware/core/kept_tick.hpp"
#include "firmware/core/mailbox.hpp"
#include "firmware/core/outputs.hpp"
#include "firmware/core/renderer.hpp"
#include "firmware/core/servo.hpp"
#include "firmware/core/supervisor.hpp"
#include "firmware/core/tuning.hpp"
#include "firmware/link/endpoint.hpp"
#include "firmware/ports/ports.hpp"
#include "shared/device/parameters.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::firmware {

// One per board; too large for a stack. `limits` outlive it, and do not change. isr_tick() and background()
// may run concurrently, as they do on a board.
//
// With background() run once after each isr_tick(), a board's output depends on its inputs only, to the bit:
// that is how the native board and an emulated one can be compared.
template <BoardPort Board>
class App {
 public:
  App(Board& board, const BoardIdentity& identity, const CatchUpPolicy& catch_up_policy,
      const Limits& limits = kDefaultLimits)
      : board_(board),
        outputs_(board),
        limits_(limits),
        renderer_(wire::kSchemaHash, catch_up_policy),
        servo_(device::kPremium15, limits_, static_cast<std::uint32_t>(wire::kSchemaHash), renderer_,
               mailbox_),
        endpoint_(renderer_, servo_, limits_, mailbox_, board.link(), identity, board.clock_Hz()) {
    Tuning tuning;
    if (std::array<std::uint8_t, kTuningBytes> kept; board.read_parameters(kept))
      (void)unpack_tuning(kept, tuning);
    servo_.begin(tuning);
    KeptTick before;
    if (recall(board.kept_words(), before)) servo_.begin(before.heat);
    endpoint_.registers().begin(tuning, board.keeps_parameters(), board.reset_report(), before);
  }

  // Interrupt context, top priority, every millisecond.
  void isr_tick();

  // Any context: true when a servo tick has passed since the last background().
  [[nodiscard]] bool background_due() const {
    return ticks_run_.load(std::memory_order_acquire) != ticks_handled_.load(std::memory_order_relaxed);
  }
  // Background context: once after each servo tick. One that comes while it still runs is handled by the next
  // call, together with those after it, and counted as overrun.
  void background();

  [[nodiscard]] const Endpoint& endpoint() const { return endpoint_; }

 private:
  [[gnu::noinline]] void store_tuning();  // its bytes do not lie below the endpoint's stack
  TickReport report(const ServoOutput& output) const;
  [[gnu::noinline]] void isr_keep(const ServoOutput& output);  // nor this below the servo's

  Board& board_;
  Outputs<Board> outputs_;
  const Limits& limits_;
  DeadlineMonitor deadlines_;
  Mailbox mailbox_{};
  Renderer renderer_;
  Servo servo_;
  Endpoint endpoint_;

  std::uint32_t new_missed_deadlines_ = 0;       // interrupt's own
  std::uint32_t background_overruns_ = 0;        // interrupt's own
  std::uint32_t previous_busy_count_ = 0;        // interrupt's own
  std::atomic<std::uint32_t> ticks_run_{0};      // written by the interrupt
  std::atomic<std::uint32_t> ticks_handled_{0};  // written by the background
  // Clock counts spent in the interrupt so far: the background subtracts what interrupted it.
  std::atomic<std::uint32_t> interrupt_total_count_{0};  // written by the interrupt
  // Length of the background runs that ended since the last tick began, without interrupts.
  std::atomic<std::uint32_t> background_count_{0};
};

template <BoardPort Board>
void App<Board>::isr_tick() {
  const std::uint32_t begin_count = board_.clock_count();
  const std::uint32_t ticks_run = ticks_run_.load(std::memory_order_relaxed);
  if (ticks_run == 0) deadlines_.isr_start(board_.clock_Hz() / kServoRate_Hz, board_.first_due_count());
  if (!deadlines_.isr_begin(begin_count)) return;
  const std::uint32_t tick = deadlines_.tick();
  if (ticks_handled_.load(std::memory_order_acquire) != ticks_run) ++background_overruns_;
  previous_busy_count_ = deadlines_.tick_count() + background_count_.exchange(0, std::memory_order_relaxed);

  board_.isr_begin_tick(tick);
  const ServoOutput output = servo_.isr_tick({.tick = tick,
                                              .elapsed_ticks = deadlines_.elapsed_ticks(),
                                              .new_missed_deadlines = new_missed_deadlines_,
                                              .missed_deadlines = deadlines_.missed_deadlines(),
                                              .worst_tick_count = deadlines_.worst_tick_count()},
                                             {.count = board_.isr_encoder_counts(),
                                              .measured_current_A = board_.isr_measured_currents_A(),
                                              .emergency_stop_open = board_.isr_emergency_stop_open(),
                                              .supply_low = board_.isr_supply_low()});
  outputs_.isr_apply(output.outputs_on, output.setpoint_A);

  isr_keep(output);

  new_missed_deadlines_ = deadlines_.isr_check(board_.clock_count());
  board_.isr_end_tick(report(output));
  deadlines_.isr_end(board_.clock_count());
  interrupt_total_count_.store(
      interrupt_total_count_.load(std::memory_order_relaxed) + deadlines_.tick_count(),
      std::memory_order_relaxed);
  ticks_run_.store(ticks_run + 1, std::memory_order_release);
}

template <BoardPort Board>
void App<Board>::background() {
  const std::uint32_t ticks = ticks_run_.load(std::memory_order_acquire);
  const std::uint32_t begin_count = board_.clock_count();
  const std::uint32_t interrupt_begin_count = interrupt_total_count_.load(std::memory_order_relaxed);

  board_.poll_receive();
  endpoint_.run();
  store_tuning();
  board_.start_transmit();

  const std::uint32_t interrupted_count =
      interrupt_total_count_.load(std::memory_order_relaxed) - interrupt_begin_count;
  background_count_.fetch_add(board_.clock_count() - begin_count - interrupted_count,
                              std::memory_order_relaxed);
  ticks_handled_.store(ticks, std::memory_order_release);
}

template <BoardPort Board>
void App<Board>::store_tuning() {
  const Tuning* const tuning = endpoint_.registers().to_store();
  if (tuning == nullptr) return;
  std::array<std::uint8_t, kTuningBytes> bytes;
  pack_tuning(*tuning, bytes);
  endpoint_.registers().stored(board_.write_parameters(bytes));
}

template <BoardPort Board>
void App<Board>::isr_keep(const ServoOutput& output) {
  keep({.tick = deadlines_.tick(), .faults = output.faults, .heat = servo_.heat()}, board_.kept_words());
}

template <BoardPort Board>
TickReport App<Board>::report(const ServoOutput& output) const {
  return {.tick = deadlines_.tick(),
          .next_tick = deadlines_.next_tick(),
          .tip_m = output.sample.tip_m,
          .force_N = output.force_N,
          .contact_mode = static_cast<std::uint32_t>(output.sample.mode),
          .triangle = output.sample.triangle,
          .barycentric = renderer_.contact_barycentric(),
          .normal = renderer_.contact_normal(),
          .mode = static_cast<std::uint32_t>(output.mode),
          .faults = output.faults,
          .model_sequence = renderer_.model_sequence(),
          .model_age_ticks = renderer_.model_age_ticks(),
          .catch_up_ticks = renderer_.catch_up_ticks(),
          .missed_deadlines = deadlines_.missed_deadlines(),
          .background_overruns = background_overruns_,
          .tick_count = deadlines_.tick_count(),
          .busy_count = previous_busy_count_,
          .clock_Hz = board_.clock_Hz()};
}

}  // namespace palpate::firmware
