// A board whose hardware is the other end of two byte streams: fulfils the ports of firmware/ports/ports.hpp
// for every emulated board, so that they differ only in their Platform.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "boards/lockstep/exchange.hpp"
#include "firmware/ports/ports.hpp"

namespace palpate::board {

// What lies under an emulated board.
template <class P>
concept Platform = requires(P& platform, const P& constant, std::span<std::byte> in,
                            std::span<const std::byte> out, firmware::LinkBuffers& link) {
  // False: there is no plant; encoders read zero, currents as wanted, and the link is a line of the
  // platform's own.
  { constant.has_plant() } -> std::same_as<bool>;
  // Blocks until all bytes are there; false at the end of the stream. Interrupt context.
  { platform.read_sensors(in) } -> std::same_as<bool>;
  { platform.write_actuators(out) } -> std::same_as<bool>;
  // Ends the run. Any context.
  { platform.exit(lockstep::ExitCode::shutdown) } -> std::same_as<void>;
  { constant.clock_count() } -> std::same_as<std::uint32_t>;
  { constant.clock_Hz() } -> std::same_as<std::uint32_t>;
  { constant.first_due_count() } -> std::same_as<std::uint32_t>;
  // Test inputs. Interrupt context.
  { platform.burn() } -> std::same_as<void>;
  { platform.crash() } -> std::same_as<void>;
  // Starts the firmware again, with nothing of what it knew; does not return.
  { platform.reset() } -> std::same_as<void>;
  // Without a plant: sends what the line takes. Background context.
  { platform.transmit(link) } -> std::same_as<void>;
};

// The two frames that cross between board and plant. They stand for the plant's side of the pins, not for
// memory of the firmware, so a platform may place them outside the memory that the part has.
struct ExchangeFrames {
  lockstep::SensorFrame sensors{};
  lockstep::ActuatorFrame actuators{};
};

// Wire: what the link's bytes in the exchange are (byte_wire.hpp, usb_wire.hpp).
template <Platform P, class Wire>
class EmulatedBoard : public firmware::KeepsNothing {
 public:
  EmulatedBoard(P& platform, ExchangeFrames& frames, typename Wire::Hardware& hardware,
                const std::array<std::uint8_t, 16>& unique_id)
      : platform_(platform), frames_(frames), wire_(link_, hardware, unique_id) {
    frames_ = {};
    frames_.actuators.magic = lockstep::kActuatorMagic;
  }

  // Before the first tick.
  void begin() { wire_.begin(); }

  // TickPort
  void isr_begin_tick(std::uint32_t tick) {
    frames_.actuators.tick = tick;
    if (!platform_.has_plant()) return;
    lockstep::SensorFrame& sensors = frames_.sensors;
    if (!platform_.read_sensors(std::as_writable_bytes(std::span(&sensors, 1)))) {
      platform_.exit(lockstep::ExitCode::peer_closed);
    }
    if (sensors.magic != lockstep::kSensorMagic || sensors.tick != tick ||
        sensors.link_length > lockstep::kLinkBytesPerTick) {
      platform_.exit(lockstep::ExitCode::protocol_error);
    }
    if ((sensors.flags & lockstep::kReset) != 0) platform_.reset();
    wire_.isr_receive(std::span(sensors.link).first(sensors.link_length));
    if ((sensors.flags & lockstep::kCrash) != 0) platform_.crash();
    if ((sensors.flags & lockstep::kBurnCycles) != 0) platform_.burn();
  }
  void isr_end_tick(const firmware::TickReport& report) {
    if (!platform_.has_plant()) return;
    const bool shutdown = (frames_.sensors.flags & lockstep::kShutdown) != 0;
    if (shutdown) isr_disable_amplifiers();
    lockstep::ActuatorFrame& frame = frames_.actuators;
    frame.next_tick = report.next_tick;
    frame.setpoint_A = enabled_ ? setpoint_A_ : std::array<float, 3>{};
    frame.enabled = enabled_ ? 1 : 0;
    frame.tip_m = {report.tip_m.x, report.tip_m.y, report.tip_m.z};
    frame.force_N = {report.force_N.x, report.force_N.y, report.force_N.z};
    frame.contact_mode = report.contact_mode;
    frame.triangle = report.triangle;
    frame.barycentric = {report.barycentric.x, report.barycentric.y, report.barycentric.z};
    frame.normal = {report.normal.x, report.normal.y, report.normal.z};
    frame.mode = report.mode;
    frame.faults = report.faults;
    frame.model_sequence = report.model_sequence;
    frame.model_age_ticks = report.model_age_ticks;
    frame.catch_up_ticks = report.catch_up_ticks;
    frame.missed_deadlines = report.missed_deadlines;
    frame.background_overruns = report.background_overruns;
    frame.tick_count = report.tick_count;
    frame.busy_count = report.busy_count;
    frame.clock_Hz = report.clock_Hz;
    frame.link_length = static_cast<std::uint32_t>(wire_.isr_transmit(frame.link));
    send();
    if (shutdown) platform_.exit(lockstep::ExitCode::shutdown);
  }

  // EncoderPort, AmplifierPort, EmergencyStopPort, SupplyPort
  std::array<std::int32_t, 3> isr_encoder_counts() const { return frames_.sensors.encoder_count; }
  // Without a plant the amplifiers are ideal.
  std::array<float, 3> isr_measured_currents_A() const {
    if (platform_.has_plant()) return frames_.sensors.current_A;
    return enabled_ ? setpoint_A_ : std::array<float, 3>{};
  }
  bool isr_emergency_stop_open() const { return (frames_.sensors.flags & lockstep::kEmergencyStop) != 0; }
  bool isr_supply_low() const { return (frames_.sensors.flags & lockstep::kSupplyLow) != 0; }
  void isr_set_currents(const std::array<float, 3>& setpoint_A) { setpoint_A_ = setpoint_A; }
  void isr_enable_amplifiers(firmware::EnableKey) { enabled_ = true; }
  void isr_disable_amplifiers() { enabled_ = false; }

  // ClockPort
  std::uint32_t clock_count() const { return platform_.clock_count(); }
  std::uint32_t clock_Hz() const { return platform_.clock_Hz(); }
  std::uint32_t first_due_count() const { return platform_.first_due_count(); }

  // LinkPort
  firmware::LinkBuffers& link() { return link_; }
  void poll_receive() {
    if (platform_.has_plant()) wire_.poll_receive();
  }
  void start_transmit() {
    if (platform_.has_plant()) {
      wire_.start_transmit();
    } else {
      platform_.transmit(link_);
    }
  }

  // Processor fault: outputs off. The plant waits for one ActuatorFrame whenever the board runs, so it gets a
  // last one.
  void fail_safe() {
    isr_disable_amplifiers();
    if (!platform_.has_plant()) return;
    frames_.actuators.setpoint_A = {};
    frames_.actuators.enabled = 0;
    frames_.actuators.link_length = 0;
    send();
  }

 private:
  void send() {
    if (!platform_.write_actuators(std::as_bytes(std::span(&frames_.actuators, 1)))) {
      platform_.exit(lockstep::ExitCode::peer_closed);
    }
  }

  P& platform_;
  ExchangeFrames& frames_;
  firmware::LinkBuffers link_{};
  Wire wire_;
  std::array<float, 3> setpoint_A_{};
  bool enabled_ = false;
};

}  // namespace palpate::board
