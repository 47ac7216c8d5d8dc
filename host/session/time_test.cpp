// How well a host knows the board's time over every medium, measured against the true one: by what the board
// sends anyway (BoardClock), and as a slave of the standard's time synchronization (uavcan.time).
//
// One program for each framing (firmware/link/framing.hpp), and one for USB; the board is the firmware in
// memory.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "host/link/framing.hpp"
#include "host/link/host_endpoint.hpp"
#include "host/link/metered_link.hpp"
#include "host/session/board_clock.hpp"
#include "host/session/test_board.hpp"
#include "shared/wire/node.hpp"
#ifdef PALPATE_TIME_OVER_USB
#include "boards/lockstep/usb_wire.hpp"
// TinyUSB begins once in a program: the boards behind the first pull the bus up by this.
extern "C" void dcd_connect(std::uint8_t port);
#endif

namespace palpate::host {
namespace {

struct Case {
  const char* name;
  link::MeteredLinkOptions link;
  std::size_t time_bytes;  // of a time message on the link
  double longest_wait_ms;  // of one behind what is on its way, and what waits in front of it
};

// Time message: 7 bytes in one frame. On a serial line it waits for what the board has handed over before:
// a trace, a status and a report at most, 152, 97 and 56 bytes; on CAN, where it has the higher priority, for
// the longest frame.
std::vector<Case> cases() {
#ifdef PALPATE_TIME_OVER_USB
  // A packet leaves in the frame behind the one in which it is asked for, and the exchange tells of it with
  // the next (host/link/usb_host.hpp).
  return {{"usb", {.medium = link::MediumKind::usb}, 38, 2.0 + 2.0 * (305 + 7 * 13) / 1500}};
#endif
  if constexpr (std::is_same_v<firmware::LinkFraming, firmware::SerialFraming>)
    return {{"uart", {.medium = link::MediumKind::uart, .baud = 921'600}, 38, 305 * 10 / 921.6}};
  if constexpr (std::is_same_v<firmware::LinkFraming, firmware::ClassicCanFraming>)
    return {{"can", {.medium = link::MediumKind::can}, 15, 0.16}};
  return {{"canfd", {.medium = link::MediumKind::canfd}, 15, 0.2}};
}

// As the public definition of uavcan.time.Synchronization.1.0 describes a slave; times in us.
class Slave {
 public:
  void take(std::uint64_t previous_us, std::uint64_t transfer_id, double now_us) {
    constexpr double kMaxPeriod_us = 1e6;
    // On CAN of 5 bits.
    const bool in_order = ((transfer_id - transfer_id_ - 1) & ((1u << wire::kCanTransferIdBits) - 1)) == 0;
    const bool follows = seen_ && previous_us != 0 && in_order && now_us - received_us_ <= kMaxPeriod_us;
    if (follows) ahead_us_ = received_us_ - static_cast<double>(previous_us);
    seen_ = true;
    transfer_id_ = transfer_id;
    received_us_ = now_us;
  }
  // The master's time; none before two messages.
  [[nodiscard]] std::optional<double> at(double now_us) const {
    return ahead_us_ ? std::optional(now_us - *ahead_us_) : std::nullopt;
  }

 private:
  bool seen_ = false;
  std::uint64_t transfer_id_ = 0;
  double received_us_ = 0.0;
  std::optional<double> ahead_us_;
};

struct Errors {
  double least_ms = 1e9, most_ms = -1e9, sum_ms = 0.0;
  std::uint32_t count = 0;
  void add(double late_ms) {
    least_ms = std::min(least_ms, late_ms);
    most_ms = std::max(most_ms, late_ms);
    sum_ms += late_ms;
    ++count;
  }
};

struct Measured {
  Errors clock, slave;  // by how much the host's idea of the board's time is late
};

constexpr std::uint32_t kTicks = 12'000, kSettling_ticks = 3000;
#ifdef PALPATE_TIME_OVER_USB
constexpr std::uint32_t kFirst_tick = 85;  // the device is there by then
#else
constexpr std::uint32_t kFirst_tick = 5;  // before full traces have filled classic CAN
#endif
constexpr double kHostStarted_s = 77.0;

// `quartz`: how much faster the host's clock runs than the board's. `most_late_ticks`: what has come waits so
// long at most, by chance, before the host takes it.
Measured run(const Case& given, double quartz, std::uint32_t most_late_ticks) {
#ifdef PALPATE_TIME_OVER_USB
  test::MemoryPeerOn<board::UsbWire> board;
  dcd_connect(0);
#else
  test::MemoryPeer board;
#endif
  const auto metered = link::make_metered_link(given.link);
  const link::FramingKind kind = link::framing_of(given.link.medium);
  link::HostEndpoint sender({.framing = kind}), receiver({.framing = kind});
  const auto framing = link::make_framing(kind);
  std::mt19937 random(3);
  std::uniform_int_distribution<std::uint32_t> late_ticks(0, most_late_ticks);
  std::deque<std::pair<std::uint32_t, std::vector<std::uint8_t>>> late;
  BoardClock clock;
  Slave slave;
  Measured measured;
  palpate_ModelState_1_0 state{};
  state.displacement.count = 96;
  state.q.count = state.p.count = 72;
  for (std::uint32_t tick = 0; tick < kTicks; ++tick) {
    // Tips alone, as CAN wants it; a state 30 times a second, for a basis that never comes; a heartbeat.
    if (tick == kFirst_tick) {
      palpate_TraceRequest_1_0 tips{};
      tips.form = palpate_TraceRequest_1_0_FORM_TIP;
      tips.ticks = 4;
      (void)metered->down().submit(sender.encode(tips).bytes, tick);
    }
    if (tick % 33 == 20) (void)metered->down().submit(sender.encode(state).bytes, tick);
    if (tick % 1000 == 100)
      (void)metered->down().submit(
          sender.encode_payload(wire::kHeartbeatSubject, std::vector<std::uint8_t>(7)).bytes, tick);
    lockstep::SensorFrame sensors{};
    sensors.magic = lockstep::kSensorMagic;
    sensors.tick = tick;
    const std::vector<std::uint8_t> down = metered->down().deliver(tick);
    std::copy(down.begin(), down.end(), sensors.link.begin());
    sensors.link_length = static_cast<std::uint32_t>(down.size());
    lockstep::ActuatorFrame actuators{};
    board.send(sensors);
    board.receive(actuators);
    (void)metered->up().submit(std::span(actuators.link).first(actuators.link_length), tick);

    const std::uint32_t now = tick + 1;
    const double local_s = kHostStarted_s + 1e-3 * now * (1.0 + quartz);
    late.emplace_back(now + late_ticks(random), metered->up().deliver(now));
    while (!late.empty() && late.front().first <= now) {
      std::span<const std::uint8_t> bytes(late.front().second);
      for (const link::Incoming& message : receiver.receive(bytes, now))
        if (const auto* trace = std::get_if<palpate_TipTrace_1_0>(&message))
          (void)clock.hear(trace->first_tick + 1 + static_cast<std::uint32_t>(trace->offsets.count), local_s);
      for (bool more = true; more;) {
        const wire::Reception reception = framing->receive(bytes, now);
        bytes = bytes.subspan(reception.consumed);
        more = reception.complete;
        if (!more || reception.frame.header.specifier != wire::kTimeSubject) continue;
        std::uint64_t previous_us = 0;
        for (std::size_t i = 0; i < 7; ++i)
          previous_us |= std::uint64_t{reception.frame.payload[i]} << (8 * i);
        slave.take(previous_us, reception.frame.header.transfer_id, 1e6 * local_s);
      }
      late.pop_front();
    }
    if (tick < kSettling_ticks) continue;
    const double true_ms = now;
    measured.clock.add(true_ms - static_cast<double>(clock.tick(local_s)));
    const auto master_us = slave.at(1e6 * local_s);
    EXPECT_TRUE(master_us.has_value());
    if (master_us) measured.slave.add(true_ms - 1e-3 * *master_us);
  }
  return measured;
}

void tell(const std::string& name, const Errors& errors) {
  testing::Test::RecordProperty(name + "_least_ms", std::to_string(errors.least_ms));
  testing::Test::RecordProperty(name + "_mean_ms", std::to_string(errors.sum_ms / errors.count));
  testing::Test::RecordProperty(name + "_most_ms", std::to_string(errors.most_ms));
}

// The bound of both. A message of tick k is there at k + d: d is the way, transfer and wait, up to the next
// tick, and what the host was late in addition. Neither hears of the way: both clocks are late by d.
// BoardClock holds the shortest d of late, less its allowance for quartzes of 1 ms a second, and counts whole
// ticks: from the shortest d there can be to the longest that there may be, and a tick. The slave has the d
// of the last pair of messages, and drifts until the next: 0.1 ms a second, for 1.5 s at most.
TEST(BoardTime, IsKnownAsWellAsTheLinkAllows) {
  constexpr double kDrift_ms = 1.5 * 0.1, kTick_ms = 1.0;
  for (const Case& given : cases()) {
    for (const double quartz : {-1e-4, 0.0, 1e-4}) {
      for (const std::uint32_t late_ticks : {0u, 3u}) {
        const Measured measured = run(given, quartz, late_ticks);
        const std::string name = std::string(given.name) +
                                 (quartz < 0   ? "_slow"
                                  : quartz > 0 ? "_fast"
                                               : "") +
                                 "_late_" + std::to_string(late_ticks);
        tell(name + "_clock", measured.clock);
        tell(name + "_slave", measured.slave);
        const double bytes_per_ms = given.link.medium == link::MediumKind::uart ? 92.16 : 1e9;
        const double most_ms =
            std::ceil(given.longest_wait_ms + static_cast<double>(given.time_bytes) / bytes_per_ms + 0.2) +
            late_ticks;
        EXPECT_GE(measured.clock.least_ms, kTick_ms) << name;
        EXPECT_LE(measured.clock.most_ms, most_ms + 2 * kTick_ms) << name;
        EXPECT_GE(measured.slave.least_ms, kTick_ms - kDrift_ms) << name;
        EXPECT_LE(measured.slave.most_ms, most_ms + kDrift_ms) << name;
      }
    }
  }
}

}  // namespace
}  // namespace palpate::host
