// palpate_device.h on the host's end of the link.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "host/device_api/palpate_device.h"
#include "host/link/host_endpoint.hpp"
#include "host/link/known_boards.hpp"
#include "host/link/transport.hpp"

namespace {

using namespace palpate;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Lock = std::unique_lock<std::mutex>;

constexpr auto kReadPatience = 50ms;  // the reader looks that often whether it is to end
constexpr auto kRetry = 250ms;        // a frame that was lost is sent again
constexpr auto kSilence = 500ms;      // without a state: five statuses of the board, too
constexpr auto kCommandPatience = 1s;
constexpr auto kOpenPatience = 3s;
constexpr auto kCalibrationPatience = 2s;
constexpr std::uint32_t kRest_ticks = 100;         // of a calibration
constexpr std::uint32_t kCalibration_ticks = 150;  // it begins within some
constexpr std::uint32_t kSlack_ticks = 10;         // states that came late or not
constexpr double kTicksPerS = 1000.0;
constexpr double kLinkShare = 0.9;    // of its rate, for states and forces
constexpr double kMost_ticks = 32.0;  // from one state to the next (palpate.TraceRequest)
constexpr double kMost_N = 1e6;       // of a force that is meant

static_assert(PALPATE_MODE_DIRECT == palpate_BoardStatus_1_0_MODE_DIRECT);
static_assert(PALPATE_MODE_SUSPENDED == palpate_BoardStatus_1_0_MODE_SUSPENDED);
static_assert(PALPATE_MODE_FAULT == palpate_BoardStatus_1_0_MODE_FAULT);

// What a call ends with when it does not end well.
struct Problem {
  palpate_result result;
  std::string text;
};

constexpr const char* kModes[] = {"boot", "idle", "calibrate", "render", "fault", "direct", "suspended"};

std::string mode_name(std::uint8_t mode) {
  return mode < std::size(kModes) ? kModes[mode] : std::to_string(mode);
}

// By the bits of palpate::firmware::Fault (firmware/core/supervisor.hpp).
constexpr const char* kFaults[] = {
    "emergency_stop",    "stop_command", "not_a_number",      "encoder_jump",    "over_speed",
    "outside_workspace", "over_current", "force_implausible", "deadline_missed", "link_lost",
    "energy_created",    "motor_heat",   "current_tracking",  "supply_low"};

std::string fault_names(unsigned faults) {
  std::string names;
  for (std::size_t bit = 0; bit < 16; ++bit)
    if ((faults >> bit & 1u) != 0)
      names += (names.empty() ? "" : ", ") +
               (bit < std::size(kFaults) ? std::string(kFaults[bit]) : "bit " + std::to_string(bit));
  return names;
}

// Of its own for each program on this computer, so that the board can tell them apart; palpate's host is node
// 10, the board 42.
std::uint16_t own_node() {
  constexpr std::uint16_t kFirst = 50, kNodes = 70;  // CAN has 128
  return static_cast<std::uint16_t>(kFirst + ::getpid() % kNodes);
}

// From one state to the next, so that states and the forces that answer them leave a part of the link for
// statuses and commands.
double ticks_between_states(const link::Transport& link) {
  if (link.bytes_per_s() <= 0.0) return 1.0;
  const auto framing = link::make_framing(link.framing());
  const auto bytes = [&framing]<class Message>(const Message&) {
    const std::vector<std::uint8_t> payload(wire::MessageTraits<Message>::kMaxBytes, 0xA5);
    const wire::FrameHeader header{.source = wire::kBoardNode,
                                   .destination = wire::kBroadcast,
                                   .specifier = wire::MessageTraits<Message>::kSpecifier};
    return static_cast<double>(framing->encode(header, payload).size());
  };
  // A serial line carries both ways at once; a CAN bus is one.
  const double both = link.framing() == link::FramingKind::serial
                          ? bytes(palpate_DeviceState_1_0{})
                          : bytes(palpate_DeviceState_1_0{}) + bytes(palpate_DirectForce_1_0{});
  return std::max(1.0, std::ceil(kTicksPerS * both / (kLinkShare * link.bytes_per_s())));
}

template <class Text>
void copy_text(const Text& from, std::span<char> to) {
  const std::size_t length = std::min(static_cast<std::size_t>(from.count), to.size() - 1);
  std::copy_n(from.elements, length, to.begin());
  to[length] = '\0';
}

thread_local std::string opening_error;  // of palpate_device_open()

}  // namespace

struct palpate_device {
  explicit palpate_device(std::unique_ptr<link::Transport> opened)
      : link(std::move(opened)),
        state_ticks(static_cast<std::uint8_t>(std::min(ticks_between_states(*link), kMost_ticks))),
        endpoint({.node = own_node(),
                  .first_transfer_id = link::fresh_transfer_id(),
                  .framing = link->framing()}) {}
  ~palpate_device() {
    stop = true;
    if (reader.joinable()) reader.join();
  }
  palpate_device(const palpate_device&) = delete;
  palpate_device& operator=(const palpate_device&) = delete;

  void start() {
    reader = std::thread([this] { read(); });
    Lock lock(mutex);
    const auto begun = Clock::now();
    ask_for_info(lock, begun);
    const double needed = ticks_between_states(*link);
    if (needed > std::min(kMost_ticks, static_cast<double>(info.direct_hold_ticks)))
      throw Problem{
          PALPATE_CANNOT_OPEN,
          named("carries a state every " + std::to_string(static_cast<int>(needed)) +
                " ms, but a force is held only " + std::to_string(info.direct_hold_ticks) + ": too slow")};
    while (!state || state->mode == PALPATE_MODE_BOOT) {  // some 20 ms after it starts
      if (Clock::now() - begun > kOpenPatience) throw Problem{PALPATE_NO_BOARD, named("sends no states")};
      ask_for_states();
      changed.wait_for(lock, kRetry);
    }
  }

  palpate_device_info get_info() {
    const Lock lock(mutex);
    palpate_device_info out{};
    copy_text(info.board, out.board);
    copy_text(info.firmware, out.firmware);
    out.tick_rate_Hz = info.tick_rate_Hz;
    out.state_rate_Hz = info.tick_rate_Hz / static_cast<double>(state_ticks);
    out.max_force_N = info.direct_force_N;
    out.max_force_step_N = info.direct_force_step_N;
    out.force_hold_s = info.direct_hold_ticks / static_cast<double>(info.tick_rate_Hz);
    return out;
  }

  palpate_device_state get_state() {
    Lock lock(mutex);
    return current();
  }

  palpate_device_state wait(double timeout_s) {
    Lock lock(mutex);
    const auto patience = std::chrono::duration<double>(std::min(timeout_s, 3600.0));
    if (!changed.wait_for(lock, patience, [this] { return state->tick != returned_tick || is_lost(); }))
      throw Problem{PALPATE_TIMEOUT, named("no new state in time")};
    const palpate_device_state now = current();
    returned_tick = now.tick;
    return now;
  }

  void enable() {
    Lock lock(mutex);
    (void)current();
    if (!link::is_known_board(board_name()))
      throw Problem{PALPATE_REFUSED, named(link::unknown_board_text(board_name()))};
    const auto challenge = command(lock, palpate_Command_Request_1_0_ARM_DIRECT, 0, "to enable");
    may_be_on = true;  // from here on leave it disabled, whatever happens
    (void)command(lock, palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token, "to enable");
    until_state(lock, kCommandPatience, [this] { return state->mode == PALPATE_MODE_DIRECT; });
    enabled = true;
  }

  void disable() {
    Lock lock(mutex);
    enabled = false;
    pending.reset();
    (void)command(lock, palpate_Command_Request_1_0_DISARM, 0, "to disable");
    until_state(lock, kCommandPatience, [this] { return state->mode != PALPATE_MODE_DIRECT; });
    may_be_on = false;
  }

  void calibrate() {
    Lock lock(mutex);
    const std::uint32_t asked_tick = current().tick;
    rest_began_tick.reset();
    (void)command(lock, palpate_Command_Request_1_0_CALIBRATE, 0, "to calibrate");
    until_state(lock, kCalibrationPatience, [&] {
      return state->tick - asked_tick > kCalibration_ticks && state->mode != PALPATE_MODE_CALIBRATE;
    });
    // An arm that moves ends it before its time.
    const std::uint32_t rest_ticks = rest_began_tick ? rest_ended_tick - *rest_began_tick : 0;
    if (rest_ticks + 2u * state_ticks + kSlack_ticks < kRest_ticks)
      throw Problem{PALPATE_REFUSED, named("calibrating: the arm did not rest for 0.1 s")};
  }

  void clear_fault() {
    Lock lock(mutex);
    (void)command(lock, palpate_Command_Request_1_0_CLEAR_FAULT, 0, "to clear the fault");
    until_state(lock, kCommandPatience, [this] { return state->mode != PALPATE_MODE_FAULT; });
  }

  void set_force(const double* force_N) {
    Lock lock(mutex);
    (void)current();
    if (!enabled || state->mode != PALPATE_MODE_DIRECT)
      throw Problem{PALPATE_REFUSED,
                    named("outputs are not on for this program, but in mode " + condition())};
    palpate_DirectForce_1_0 message{};
    for (std::size_t i = 0; i < 3; ++i) message.force_N[i] = static_cast<float>(force_N[i]);
    pending = message;
    if (may_send) send_pending();
  }

  // Best effort: the board switches off by itself a second later.
  void leave() {
    try {
      if (may_be_on) disable();
    } catch (const Problem&) {
    }
    const Lock lock(mutex);
    constexpr std::uint8_t kUsualTicks = 4;  // as a board begins
    write(endpoint.encode(palpate_TraceRequest_1_0{
        .first_tick = 0, .count = 0, .form = palpate_TraceRequest_1_0_FORM_FULL, .ticks = kUsualTicks}));
  }

  // Of whoever calls.
  std::string error_text() {
    Lock lock(mutex);
    return error;
  }
  palpate_result remember(const Problem& problem) {
    Lock lock(mutex);
    error = problem.text;
    return problem.result;
  }

 private:
  [[nodiscard]] std::string named(const std::string& what) const { return link->address() + ": " + what; }
  [[nodiscard]] std::string board_name() const {
    return {reinterpret_cast<const char*>(info.board.elements), info.board.count};
  }
  [[nodiscard]] std::string condition() const {
    return mode_name(state->mode) +
           (state->faults != 0 ? ", faults " + fault_names(state->faults) + " (docs/safety.md)" : "");
  }
  [[nodiscard]] bool is_lost() const { return !link->is_open() || Clock::now() - arrived > kSilence; }

  // Throws where the board is gone.
  palpate_device_state current() {
    if (!link->is_open()) throw Problem{PALPATE_LOST, named("the link has gone")};
    if (is_lost()) throw Problem{PALPATE_LOST, named("the board is silent")};
    palpate_device_state out{};
    out.tick = state->tick;
    for (std::size_t i = 0; i < 3; ++i) {
      out.position_m[i] = state->tip_m[i];
      out.velocity_m_s[i] = state->velocity_m_s[i];
      out.force_N[i] = state->force_N[i];
    }
    out.mode = state->mode;
    out.faults = state->faults;
    out.age_s = std::chrono::duration<double>(Clock::now() - arrived).count();
    return out;
  }

  template <class Done>
  void until_state(Lock& lock, Clock::duration patience, Done done) {
    if (!changed.wait_for(lock, patience, [&] { return done() || is_lost(); }) || !done()) {
      (void)current();
      throw Problem{PALPATE_TIMEOUT, named("it stays in mode " + condition())};
    }
  }

  void write(const link::OutgoingFrame& frame) { (void)link->write(frame.bytes); }

  void ask_for_info(Lock& lock, Clock::time_point begun) {
    while (!has_info) {
      if (!link->is_open()) throw Problem{PALPATE_CANNOT_OPEN, named("the link has gone")};
      if (Clock::now() - begun > kOpenPatience)
        throw Problem{PALPATE_NO_BOARD, named("no palpate board answers")};
      write(endpoint.encode(palpate_GetInfo_Request_1_0{}));
      changed.wait_for(lock, kRetry, [this] { return has_info || !link->is_open(); });
    }
    if (info.schema_hash != wire::kSchemaHash)
      throw Problem{PALPATE_OTHER_SCHEMA, named("the board has other message definitions than this library")};
  }

  void ask_for_states() {
    write(endpoint.encode(palpate_TraceRequest_1_0{
        .first_tick = 0, .count = 0, .form = palpate_TraceRequest_1_0_FORM_DEVICE, .ticks = state_ticks}));
  }

  // Asks until it is answered; throws where it is refused. A frame that was lost is sent as a new transfer.
  palpate_Command_Response_1_0 command(Lock& lock, std::uint8_t action, std::uint32_t token,
                                       const char* what) {
    const auto begun = Clock::now();
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    while (Clock::now() - begun < kCommandPatience) {
      if (!link->is_open()) throw Problem{PALPATE_LOST, named("the link has gone")};
      const link::OutgoingFrame frame = endpoint.encode(request);
      write(frame);
      answer.reset();
      changed.wait_for(lock, kRetry, [&] { return answer && answer->transfer_id == frame.transfer_id; });
      if (!answer || answer->transfer_id != frame.transfer_id) continue;
      const palpate_Command_Response_1_0 response = answer->message;
      if (response.status == static_cast<std::uint8_t>(Status::ok)) return response;
      // A confirmation that is repeated is refused, though the one before has worked.
      if (action == palpate_Command_Request_1_0_ARM_CONFIRM && response.mode == PALPATE_MODE_DIRECT)
        return response;
      throw Problem{PALPATE_REFUSED, named(std::string("the board refuses ") + what + " in mode " +
                                           condition() + ": status " + std::to_string(response.status))};
    }
    throw Problem{PALPATE_TIMEOUT, named(std::string("no answer to the command ") + what)};
  }

  void send_pending() {
    write(endpoint.encode(*pending));
    pending.reset();
    may_send = false;
  }

  // The thread.
  void read() {
    try {
      read_until_stopped();
    } catch (const std::exception&) {
      stop = true;  // out of memory: the rest sees a silent board
    }
  }

  void read_until_stopped() {
    const auto begun = Clock::now();
    while (!stop) {
      if (!link->is_open()) std::this_thread::sleep_for(kReadPatience);  // nothing comes any more
      const auto bytes = link->read(kReadPatience);
      const auto passed = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begun);
      const Lock lock(mutex);
      for (const link::Incoming& incoming :
           endpoint.receive(bytes, static_cast<std::uint32_t>(passed.count())))
        std::visit([this](const auto& message) { take(message); }, incoming);
      changed.notify_all();
    }
  }

  void take(const palpate_DeviceState_1_0& message) {
    state = message;
    arrived = Clock::now();
    may_send = true;
    if (message.mode == PALPATE_MODE_CALIBRATE) {
      if (!rest_began_tick) rest_began_tick = message.tick;
      rest_ended_tick = message.tick;
    }
    // A fault, a force that did not come in time, a board that has started again: to be enabled anew.
    if (message.mode != PALPATE_MODE_DIRECT) {
      enabled = false;
      pending.reset();
    }
    if (pending) send_pending();
  }
  void take(const palpate_BoardStatus_1_0& status) {
    // It has started again, or another program has asked for something else.
    if (state &&
        (status.trace_form != palpate_TraceRequest_1_0_FORM_DEVICE || status.trace_ticks != state_ticks))
      ask_for_states();
  }
  void take(const link::CommandResponse& response) { answer = response; }
  void take(const link::InfoResponse& response) {
    if (has_info) return;  // asked twice
    info = response.message;
    has_info = true;
  }
  template <class Other>
  void take(const Other&) {}

  const std::unique_ptr<link::Transport> link;
  const std::uint8_t state_ticks;  // from one state to the next
  std::atomic<bool> stop{false};
  std::mutex mutex;  // of what follows, and of writing to the link
  std::condition_variable changed;
  link::HostEndpoint endpoint;
  bool has_info = false;
  palpate_GetInfo_Response_1_0 info{};
  std::optional<palpate_DeviceState_1_0> state;  // the newest; there once it is open
  Clock::time_point arrived{};
  std::optional<std::uint32_t> returned_tick;  // by wait()
  std::optional<link::CommandResponse> answer;
  // First and last tick of the last calibration, as far as states have told.
  std::optional<std::uint32_t> rest_began_tick;
  std::uint32_t rest_ended_tick = 0;
  bool enabled = false;    // in mode direct, for this program
  bool may_be_on = false;  // a confirmation was sent
  std::optional<palpate_DirectForce_1_0>
      pending;  // waits for the next state, so that the board is not flooded
  bool may_send = true;
  std::string error;
  std::thread reader;
};

namespace {

// Nothing is thrown across the border to C.
template <class Call>
palpate_result guarded(palpate_device* device, Call call) {
  if (device == nullptr) return PALPATE_BAD_ARGUMENT;
  try {
    call();
    return PALPATE_OK;
  } catch (const Problem& problem) {
    return device->remember(problem);
  } catch (const std::exception& error) {
    return device->remember({PALPATE_LOST, error.what()});
  }
}

template <class Out, class Call>
palpate_result guarded(palpate_device* device, Out* out, Call call) {
  if (device != nullptr && out == nullptr)
    return device->remember({PALPATE_BAD_ARGUMENT, "the pointer to the result is null"});
  return guarded(device, [&] { *out = call(); });
}

}  // namespace

palpate_result palpate_device_open(const char* address, palpate_device** device) {
  opening_error.clear();
  if (device != nullptr) *device = nullptr;
  if (device == nullptr || address == nullptr) {
    opening_error = "address or device is a null pointer";
    return PALPATE_BAD_ARGUMENT;
  }
  try {
    auto opened = std::make_unique<palpate_device>(link::open_transport(address));
    opened->start();
    *device = opened.release();
    return PALPATE_OK;
  } catch (const Problem& problem) {
    opening_error = problem.text;
    return problem.result;
  } catch (const std::exception& error) {
    opening_error = error.what();
    return PALPATE_CANNOT_OPEN;
  }
}

void palpate_device_close(palpate_device* device) {
  if (device == nullptr) return;
  const std::unique_ptr<palpate_device> owner(device);
  device->leave();
}

const char* palpate_device_error(const palpate_device* device) {
  if (device == nullptr) return opening_error.c_str();
  thread_local std::array<char, 512> text;  // another thread's next call must not change it under the reader
  const std::string now = const_cast<palpate_device*>(device)->error_text();
  text[now.copy(text.data(), text.size() - 1)] = '\0';
  return text.data();
}

palpate_result palpate_device_get_info(palpate_device* device, palpate_device_info* info) {
  return guarded(device, info, [&] { return device->get_info(); });
}

palpate_result palpate_device_get_state(palpate_device* device, palpate_device_state* state) {
  return guarded(device, state, [&] { return device->get_state(); });
}

palpate_result palpate_device_wait(palpate_device* device, double timeout_s, palpate_device_state* state) {
  if (device != nullptr && !(timeout_s >= 0.0))
    return device->remember(
        {PALPATE_BAD_ARGUMENT, "timeout_s is " + std::to_string(timeout_s) + ": must be at least 0"});
  return guarded(device, state, [&] { return device->wait(timeout_s); });
}

palpate_result palpate_device_enable(palpate_device* device) {
  return guarded(device, [&] { device->enable(); });
}

palpate_result palpate_device_disable(palpate_device* device) {
  return guarded(device, [&] { device->disable(); });
}

palpate_result palpate_device_calibrate(palpate_device* device) {
  return guarded(device, [&] { device->calibrate(); });
}

palpate_result palpate_device_clear_fault(palpate_device* device) {
  return guarded(device, [&] { device->clear_fault(); });
}

palpate_result palpate_device_set_force(palpate_device* device, const double force_N[3]) {
  if (device == nullptr) return PALPATE_BAD_ARGUMENT;
  if (force_N == nullptr) return device->remember({PALPATE_BAD_ARGUMENT, "force_N is a null pointer"});
  for (int i = 0; i < 3; ++i)
    if (!(std::fabs(force_N[i]) <= kMost_N))
      return device->remember({PALPATE_BAD_ARGUMENT, "force_N[" + std::to_string(i) + "] is " +
                                                         std::to_string(force_N[i]) +
                                                         ", allowed -1e6 to 1e6 N"});
  return guarded(device, [&] { device->set_force(force_N); });
}
