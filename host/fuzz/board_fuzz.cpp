// The whole firmware with a board in memory, under any bytes on its link, serial or CAN as the build has
// chosen, and any sensors. Whatever comes:
// outputs are on only after the two steps of arming, set-points are finite and within their limits, and zero
// while outputs are off.
#include <array>
#include <cmath>
#include <memory>
#include <type_traits>
#include <vector>

#include "firmware/app/app.hpp"
#include "firmware/test_support.hpp"
#include "host/fuzz/input.hpp"
#include "host/fuzz/line.hpp"
#include "host/fuzz/model_input.hpp"

using namespace palpate;
using firmware::test::MemoryBoard;
using fuzz::require;

namespace {

constexpr std::uint32_t kMostTicks = 600;  // of a run
constexpr link::FramingKind kFraming = std::is_same_v<firmware::LinkFraming, firmware::SerialFraming>
                                           ? link::FramingKind::serial
                                           : link::FramingKind::can_fd;

// Listens on both directions of the link and knows whether the board may have its outputs on: since it last
// had them off, the host has sent the token of a challenge that the board had answered with.
class Witness {
 public:
  void host_said(std::span<const std::uint8_t> bytes) {
    hear(*from_host_, bytes, [this](const wire::Frame& frame) {
      palpate_Command_Request_1_0 request;
      if (frame.header.specifier != wire::MessageTraits<palpate_Command_Request_1_0>::kSpecifier ||
          wire::deserialize(frame.payload, request) != Status::ok)
        return;
      if (request.action == palpate_Command_Request_1_0_ARM_CONFIRM && request._token != 0 &&
          request._token == token_)
        confirmed_ = true;
    });
  }
  void board_said(std::span<const std::uint8_t> bytes) {
    hear(*from_board_, bytes, [this](const wire::Frame& frame) {
      palpate_Command_Response_1_0 response;
      if (frame.header.specifier == wire::MessageTraits<palpate_Command_Response_1_0>::kSpecifier &&
          wire::deserialize(frame.payload, response) == Status::ok && response._token != 0)
        token_ = response._token;
      palpate_BoardStatus_1_0 status;
      if (frame.header.specifier == wire::MessageTraits<palpate_BoardStatus_1_0>::kSpecifier &&
          wire::deserialize(frame.payload, status) == Status::ok && status._token != 0)
        token_ = status._token;
    });
    require(from_board_->counters().refused() == 0, "the board sends good transfers");
  }
  // After a tick.
  void outputs_are(bool on) {
    require(!on || confirmed_, "outputs are on only after the two steps of arming");
    if (was_on_ && !on) {
      confirmed_ = false;
      token_ = 0;
    }
    was_on_ = on;
  }
  [[nodiscard]] std::uint32_t token() const { return token_; }

 private:
  template <class Take>
  static void hear(link::Framing& framing, std::span<const std::uint8_t> bytes, const Take& take) {
    constexpr std::uint32_t kTick = 1;  // nothing is too late to belong together
    for (bool complete = true; !bytes.empty() || complete;) {
      const wire::Reception reception = framing.receive(bytes, kTick);
      bytes = bytes.subspan(reception.consumed);
      complete = reception.complete;
      if (complete) take(reception.frame);
    }
  }

  std::unique_ptr<link::Framing> from_host_ = link::make_framing(kFraming);
  std::unique_ptr<link::Framing> from_board_ = link::make_framing(kFraming);
  std::uint32_t token_ = 0;
  bool confirmed_ = false, was_on_ = false;
};

class Run {
 public:
  explicit Run(fuzz::Input& input)
      : input_(input),
        board_(std::make_unique<MemoryBoard>()),
        witness_(std::make_unique<Witness>()),
        app_(std::make_unique<firmware::App<MemoryBoard>>(
            *board_, firmware::BoardIdentity{"memory", "0", {1}}, firmware::kCatchUpCortexM4)) {}

  void go() {
    ticks(25);  // past the boot
    while (!input_.empty() && ticks_ < kMostTicks) step();
    ticks(20);
  }

 private:
  enum Action : std::uint8_t {
    move,
    arm_request,
    arm_confirm,
    model,
    line,
    command,
    sensors,
    overrun,
    no_background,
    actions
  };

  void step() {
    switch (static_cast<Action>(input_.take<std::uint8_t>() % actions)) {
      case move:
        for (std::int32_t& speed : speed_count_) speed = input_.take<std::int8_t>();
        ticks(1 + input_.take<std::uint8_t>() % 64);
        return;
      case arm_request:
        command_of(palpate_Command_Request_1_0_ARM_REQUEST, 0);
        ticks(2);
        return;
      case arm_confirm:
        command_of(palpate_Command_Request_1_0_ARM_CONFIRM, witness_->token());
        ticks(2);
        return;
      case model: {
        const fuzz::ModelPayloads payloads = fuzz::take_model(input_, board_->report.tick);
        for (const auto& part : payloads.parts)
          frame_of(wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier, part);
        frame_of(wire::MessageTraits<palpate_ModelState_1_0>::kSpecifier, payloads.state);
        ticks(2);
        return;
      }
      case line: {
        constexpr std::array kSpecifiers{wire::MessageTraits<palpate_Command_Request_1_0>::kSpecifier,
                                         wire::MessageTraits<palpate_ModelState_1_0>::kSpecifier,
                                         wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier,
                                         wire::MessageTraits<palpate_TraceRequest_1_0>::kSpecifier,
                                         wire::MessageTraits<palpate_GetInfo_Request_1_0>::kSpecifier,
                                         wire::MessageTraits<palpate_DirectForce_1_0>::kSpecifier};
        send(fuzz::next_piece(input_, *framing_, wire::kHostNode, wire::kBoardNode, kSpecifiers,
                              transfer_id_));
        ticks(1);
        return;
      }
      case command:
        command_of(input_.take<std::uint8_t>(), input_.take<std::uint32_t>());
        ticks(1);
        return;
      case sensors: {
        const auto wires = input_.take<std::uint8_t>();
        board_->emergency_stop_open = wires % 4 == 3;
        board_->supply_low = wires % 32 == 1;
      }
        for (float& current_A : board_->current_A) current_A = input_.take<float>();
        for (std::int32_t& count : board_->count) count = input_.take<std::int32_t>();
        ticks(1);
        return;
      case overrun:
        board_->burn_count = input_.take<std::uint16_t>() * 16U;
        ticks(1);
        return;
      case no_background:
        for (int count = input_.take<std::uint8_t>() % 16; count >= 0; --count) interrupt();
        return;
      case actions:
        return;
    }
  }

  void command_of(std::uint8_t action, std::uint32_t token) {
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    frame_of(wire::MessageTraits<palpate_Command_Request_1_0>::kSpecifier, fuzz::payload_of(request));
  }
  void frame_of(std::uint16_t specifier, std::span<const std::uint8_t> payload) {
    send(fuzz::transfer_of(*framing_,
                           {.source = wire::kHostNode,
                            .destination = wire::kBoardNode,
                            .specifier = specifier,
                            .transfer_id = transfer_id_++},
                           payload));
  }
  // As a driver: what does not fit is dropped.
  void send(std::span<const std::uint8_t> bytes) {
    const auto fitting = bytes.first(std::min<std::size_t>(bytes.size(), board_->buffers.received.free()));
    require(board_->buffers.received.write(fitting), "a ring takes what fits");
    witness_->host_said(fitting);
  }

  void ticks(int count) {
    for (int i = 0; i < count; ++i) {
      interrupt();
      if (app_->background_due()) app_->background();
      std::vector<std::uint8_t> sent(firmware::kLinkTransmitCapacity);
      sent.resize(board_->buffers.transmit.read(sent));
      witness_->board_said(sent);
    }
  }

  void interrupt() {
    for (std::size_t i = 0; i < 3; ++i)  // as a counter wraps
      board_->count[i] = static_cast<std::int32_t>(static_cast<std::uint32_t>(board_->count[i]) +
                                                   static_cast<std::uint32_t>(speed_count_[i]));
    app_->isr_tick();
    board_->now_count += MemoryBoard::kCountPerTick;
    ++ticks_;
    const firmware::Limits limits;
    for (std::size_t i = 0; i < 3; ++i) {
      const float setpoint_A = board_->setpoint_A[i];
      require(std::isfinite(setpoint_A), "set-points are finite");
      require(std::fabs(setpoint_A) <= limits.motor_current_A[i], "set-points are within their limits");
      require(board_->enabled || setpoint_A == 0.0f, "set-points are zero while outputs are off");
    }
    require(board_->enabled == firmware::outputs_on(static_cast<firmware::Mode>(board_->report.mode)),
            "outputs are on in the modes RENDER and DIRECT and in no other");
    witness_->outputs_are(board_->enabled);
  }

  fuzz::Input& input_;
  std::unique_ptr<link::Framing> framing_ = link::make_framing(kFraming);
  std::unique_ptr<MemoryBoard> board_;
  std::unique_ptr<Witness> witness_;
  std::unique_ptr<firmware::App<MemoryBoard>> app_;
  std::array<std::int32_t, 3> speed_count_{};
  std::uint64_t transfer_id_ = 0;
  std::uint32_t ticks_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  Run(input).go();
  return 0;
}
