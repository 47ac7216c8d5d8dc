// palpate_device.h on the host's end of the link.
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

#include "host/device_api/palpate_device.h"
#include "host/link/host_endpoint.hpp"
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
constexpr std::uint32_t kCalibration_ticks = 110;  // 100 of rest, and it begins within some
constexpr double kAtReference_m = 1e-3;            // after a calibration the tip is there
constexpr double kTicksPerS = 1000.0;
// A state takes 44 bytes of payload; of the link's rate a fifth is left to statuses and answers.
constexpr double kStateFrame_bytes = 78.0;
constexpr double kLinkShare = 0.8;

static_assert(PALPATE_MODE_DIRECT == palpate_BoardStatus_1_0_MODE_DIRECT);
static_assert(PALPATE_MODE_FAULT == palpate_BoardStatus_1_0_MODE_FAULT);

// What a call ends with when it does not end well.
struct Problem {
  palpate_result result;
  std::string text;
};

constexpr const char* kModes[] = {"boot", "idle", "calibrate", "render", "fault", "direct"};

std::string mode_name(std::uint8_t mode) {
  return mode < std::size(kModes) ? kModes[mode] : std::to_string(mode);
}

std::uint64_t first_transfer_id() {
  // Other numbers than those of a program that ended a second ago: the board takes equal ones for copies.
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

std::uint8_t ticks_between_states(double bytes_per_s) {
  if (bytes_per_s <= 0.0) return 1;
  const double ticks = std::ceil(kTicksPerS * kStateFrame_bytes / (kLinkShare * bytes_per_s));
  return static_cast<std::uint8_t>(std::clamp(ticks, 1.0, 32.0));
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
        state_ticks(ticks_between_states(link->bytes_per_s())),
        endpoint({.first_transfer_id = first_transfer_id(), .framing = link->framing()}) {}
  ~palpate_device() {
    stop = true;
    if (reader.joinable()) reader.join();
  }
  palpate_device(const palpate_device&) = delete;
  palpate_device& operator=(const palpate_device&) = delete;

  void start() {
    reader = std::thread([this] { read(); });
    Lock lock(mutex);
    ask_for_info(lock);
    const auto begun = Clock::now();
    while (!state || state->mode == PALPATE_MODE_BOOT) {  // some 20 ms after it starts
      if (Clock::now() - begun > kOpenPatience) throw Problem{PALPATE_NO_BOARD, named("sends no states")};
      ask_for_states();
      changed.wait_for(lock, kRetry);
    }
  }

  palpate_device_info get_info() const {
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
    const auto challenge = command(lock, palpate_Command_Request_1_0_ARM_DIRECT, 0, "to enable");
    enabled = true;  // from here on leave it disabled, whatever happens
    (void)command(lock, palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token, "to enable");
    until_state(lock, kCommandPatience, [this] { return state->mode == PALPATE_MODE_DIRECT; });
  }

  void disable() {
    Lock lock(mutex);
    enabled = false;
    pending.reset();
    (void)command(lock, palpate_Command_Request_1_0_DISARM, 0, "to disable");
    until_state(lock, kCommandPatience, [this] { return state->mode != PALPATE_MODE_DIRECT; });
  }

  void calibrate() {
    Lock lock(mutex);
    (void)command(lock, palpate_Command_Request_1_0_CALIBRATE, 0, "to calibrate");
    const std::uint32_t begun_tick = state->tick;
    until_state(lock, kCalibrationPatience, [&] {
      return state->tick - begun_tick > kCalibration_ticks && state->mode != PALPATE_MODE_CALIBRATE;
    });
    const double away_m = std::hypot(state->tip_m[0], state->tip_m[1], state->tip_m[2]);
    if (away_m > kAtReference_m) throw Problem{PALPATE_REFUSED, named("calibrating: the tip did not rest")};
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
    if (!enabled) return;
    try {
      disable();
    } catch (const Problem&) {
    }
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
  [[nodiscard]] std::string condition() const {
    return mode_name(state->mode) +
           (state->faults != 0 ? ", faults " + std::to_string(state->faults) + " (docs/safety.md)" : "");
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

  void ask_for_info(Lock& lock) {
    const auto begun = Clock::now();
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
    const auto begun = Clock::now();
    while (!stop) {
      const auto bytes = link->read(kReadPatience);
      if (!link->is_open()) std::this_thread::sleep_for(kReadPatience);  // nothing comes any more
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
  bool enabled = false;
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
  if (device == nullptr || address == nullptr) {
    opening_error = "address or device is a null pointer";
    return PALPATE_BAD_ARGUMENT;
  }
  *device = nullptr;
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
    if (!std::isfinite(force_N[i]))
      return device->remember({PALPATE_BAD_ARGUMENT, "force_N[" + std::to_string(i) + "] is not finite"});
  return guarded(device, [&] { device->set_force(force_N); });
}
