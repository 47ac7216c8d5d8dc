// The board's end of the link: bytes to messages, messages to the renderer and the supervisor, answers and
// traces back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/mailbox.hpp"
#include "firmware/core/renderer.hpp"
#include "firmware/core/servo.hpp"
#include "firmware/link/framing.hpp"
#include "firmware/link/registers.hpp"
#include "firmware/ports/ports.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/node.hpp"
#include "shared/wire/tip_trace.hpp"
#include "shared/wire/transfer_monitor.hpp"

namespace palpate::firmware {

// Servo ticks in one trace as they happen, unless the host asks for another number: 4 ms of latency, and with
// palpate.ServoTrace a frame overhead of a quarter.
inline constexpr std::uint32_t kTraceTicks = 4;
// Traces sent in one background run: catches up after an overrun without flooding the link.
inline constexpr std::uint32_t kTracesPerRun = 4;
// Bytes that resending leaves free in the transmit ring for what is new.
inline constexpr std::uint32_t kResendReserve = 1024;
// Trace requests that may wait for their turn.
inline constexpr std::size_t kPendingTraceRequests = 4;

// STOP and DISARM that may wait for their response; one more is obeyed, and not answered.
inline constexpr std::size_t kPendingUrgent = 4;

// Background context throughout; one owner.
class Endpoint {
 public:
  Endpoint(Renderer& renderer, const Servo& servo, const Limits& limits, Mailbox& mailbox, LinkBuffers& link,
           const BoardIdentity& identity, std::uint32_t clock_Hz)
      : renderer_(renderer),
        servo_(servo),
        limits_(limits),
        mailbox_(mailbox),
        link_(link),
        identity_(identity),
        clock_Hz_(clock_Hz) {}

  // Once per servo tick: takes what the link has received, sends what is due. Its work is bounded: by the
  // receive ring, by that of CatchUpPolicy, and by a fixed number of frames of each kind.
  void run();

  // What became of the frames so far.
  struct Counters {
    std::uint32_t models_taken = 0;
    std::uint32_t models_refused = 0;
    std::uint32_t frames_refused = 0;  // good frames that mean nothing here: port, payload, or no room
    std::uint32_t frames_unsent = 0;
    Status last_status = Status::ok;  // the last that was not ok
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  Registers& registers() { return registers_; }

 private:
  void receive();
  void dispatch(const wire::Frame& frame);
  Status take_command(const wire::Frame& frame);
  void take_urgent(Action action, const Requester& requester);
  Status send_info(const wire::Frame& frame);
  Status send_node_info(const wire::Frame& frame);
  // With frames of their own on the stack, which does not lie below those of models.
  [[gnu::noinline]] Status take_register_access(const wire::Frame& frame);
  [[gnu::noinline]] Status send_register_name(const wire::Frame& frame);
  [[gnu::noinline]] void send_register_answers();
  Status take_trace_request(const wire::Frame& frame);
  Status take_direct_force(const wire::Frame& frame);
  void note(const ModelReport& report);
  void note(const BasisStore::Event& event);
  void send_model_reports();
  void send_replies();
  void send_urgent_replies();
  void send_status();
  void send_heartbeat();
  // While another node's heartbeat is heard, which every Cyphal node has: for its clock.
  void send_time();
  void send_traces();
  void send_device_state();
  void resend_traces();
  // Sends first_tick and the ticks after it, at most `count`, in the form that was asked for. Returns how
  // many the history still held.
  std::uint32_t send_trace(std::uint32_t first_tick, std::uint32_t count);
  std::uint32_t send_full_trace(std::uint32_t first_tick, std::uint32_t count);
  std::uint32_t send_tip_trace(std::uint32_t first_tick, std::uint32_t count);
  void refuse(Status status);
  // Armed by another host, so what this one says is not for it; also while the link of that one is lost.
  [[nodiscard]] bool is_refused_from(std::uint16_t node) const;
  void note_model_of(std::uint16_t node);

  // False when the frame did not fit in the transmit ring: dropped whole, and counted.
  template <class Message>
  bool send(const Message& message, const wire::FrameHeader& header);
  // Header of the next message on a subject; counts its transfers.
  template <class Message>
  wire::FrameHeader publication(std::uint64_t& transfers) const;
  template <class Response>
  wire::FrameHeader response(const Requester& requester) const;

  Renderer& renderer_;
  const Servo& servo_;
  const Limits& limits_;
  Mailbox& mailbox_;
  LinkBuffers& link_;
  BoardIdentity identity_;
  std::uint32_t clock_Hz_;

  LinkFraming framing_;
  Registers registers_{mailbox_};
  wire::TransferMonitor transfers_{LinkFraming::kTransferIdBits};
  Counters counters_{};
  std::uint32_t faults_seen_ = 0;  // refused frames that last_status already speaks of

  std::uint64_t trace_transfers_ = 0, tip_transfers_ = 0, device_transfers_ = 0;
  std::uint64_t status_transfers_ = 0, report_transfers_ = 0, basis_transfers_ = 0;
  std::uint64_t heartbeat_transfers_ = 0;  // one a second: the uptime
  std::uint64_t time_transfers_ = 0;
  std::uint32_t time_tick_ = 0;       // with which the newest of them went out; 0: none
  std::uint32_t node_seen_tick_ = 0;  // the newest heartbeat of another node
  bool node_seen_ = false;
  std::uint32_t trace_sequence_ = 0, status_sequence_ = 0;
  std::uint32_t next_trace_tick_ = 0;
  // As the host asked for it last (palpate.TraceRequest).
  std::uint8_t trace_form_ = palpate_TraceRequest_1_0_FORM_FULL;
  std::uint8_t trace_ticks_ = kTraceTicks;
  struct TickRange {
    std::uint32_t first_tick = 0;
    std::uint32_t count = 0;
  };
  std::array<TickRange, kPendingTraceRequests> requests_{};
  std::size_t request_count_ = 0;
  std::array<Requester, kPendingUrgent> urgent_{};
  std::size_t urgent_count_ = 0;
  // Of the newest status.
  Mode mode_ = Mode::boot;
  FaultSet faults_ = 0;
  // Of a board as a plain device.
  std::uint32_t next_device_tick_ = 0;

  // Scratch; too large for the stack. One trace at a time.
  static constexpr std::size_t kLargestPayload = wire::kLargestPayloadToHost;
  union {
    palpate_ServoTrace_1_0 trace_{};
    palpate_TipTrace_1_0 tip_trace_;
  };
  std::array<std::uint8_t, kLargestPayload> payload_{};
};

}  // namespace palpate::firmware
