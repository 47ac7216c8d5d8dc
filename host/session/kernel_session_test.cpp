// The host's session over drivers of a real kernel: with the firmware at the same CAN interface of this
// program, or with a board at the other end of an adapter's bus or of a USB cable. hil_tests/
// test_can_session.py and test_usb_guest.py run it where there are such: PALPATE_TEST_CAN and
// PALPATE_TEST_BOARD have an address (host/link/transport.hpp) each.
//
// One program for each framing (firmware/link/framing.hpp). What time it is the board's ticks say, so that
// nothing here depends on how fast the kernel is.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "host/link/host_endpoint.hpp"
#include "host/link/transport.hpp"
#include "host/plant/plant.hpp"
#include "host/session/emulated_device.hpp"
#include "host/session/loop_host.hpp"
#include "host/session/test_board.hpp"
#include "host/session/test_contact.hpp"
#include "host/session/test_drag.hpp"

namespace palpate::host {
namespace {

using Clock = std::chrono::steady_clock;

// Far longer than it takes in a guest on a busy machine.
constexpr auto kHangs = std::chrono::seconds(100);
constexpr std::uint32_t kEnoughModels = 3;
constexpr float kFelt_N = 0.3f;  // where 3 mm meet some 300 N/m

template <class Framing>
constexpr link::FramingKind kind_of() {
  if (std::is_same_v<Framing, firmware::SerialFraming>) return link::FramingKind::serial;
  return std::is_same_v<Framing, firmware::CanFdFraming> ? link::FramingKind::can_fd
                                                         : link::FramingKind::can_classic;
}
constexpr link::FramingKind kFraming = kind_of<firmware::LinkFraming>();

Body small_body() {
  constexpr int kNodes = 5;
  LatticeSpec spec = test::reference_spec(kNodes);
  const double side_m = 0.01 * (kNodes - 1);
  spec.origin_m = {-0.5 * side_m, -0.5 * side_m, -0.02 - side_m};
  return make_lattice(spec);
}

// The host's end.
class HostEnd {
 public:
  HostEnd(const std::string& address, TraceForm form)
      : link_(link::open_transport(address)),
        body_(small_body()),
        host_(body_, body_.rest_state(), config(form)) {
    host_.listen_to_ticks([this](std::uint32_t first_tick, std::uint32_t count, std::uint32_t) {
      heard_tick_ = std::max(heard_tick_, first_tick + count);
    });
    host_.listen([this](const palpate_ServoTrace_1_0& trace) {
      for (std::size_t i = 0; i < trace.samples.count; ++i) {
        const palpate_ServoSample_1_0& sample = trace.samples.elements[i];
        if ((sample.flags & palpate_ServoSample_1_0_FLAG_RENDERING) != 0)
          deepest_N_ = std::min(deepest_N_, sample.force_N[2]);
      }
    });
  }

  // Takes what has come, and does what is due up to the newest tick heard of.
  void run(std::chrono::microseconds patience) {
    host_.receive(link_->read(patience), heard_tick_);
    for (; polled_tick_ < heard_tick_; ++polled_tick_)
      for (const link::OutgoingFrame& frame : host_.poll(polled_tick_ + 1, 0, kBytesPerTick))
        if (!link_->write(frame.bytes)) ++unsent_;
  }
  void disarm() {
    if (!link_->write(host_.disarm().bytes)) ++unsent_;
  }
  [[nodiscard]] bool has_models() const { return host_.counters().models_taken >= kEnoughModels; }
  // By full traces.
  [[nodiscard]] bool is_felt() const { return deepest_N_ < -kFelt_N; }
  // Frames that the kernel's queue had no room for in time.
  [[nodiscard]] std::uint32_t unsent() const { return unsent_; }
  [[nodiscard]] std::uint32_t heard_tick() const { return heard_tick_; }
  [[nodiscard]] LoopCounters counters() const { return host_.counters(); }
  [[nodiscard]] const std::optional<palpate_BoardStatus_1_0>& status() const { return host_.board_status(); }

 private:
  static constexpr double kBytesPerTick = 300.0;  // the exchange with the board holds 2,048

  static ClosedLoopConfig config(TraceForm form) {
    ClosedLoopConfig config = test::drag_config(0, 5, {form, 4});
    config.framing = kFraming;
    config.session.valid_ticks = 1000;
    config.session.step_s = 2e-4;
    return config;
  }

  std::unique_ptr<link::Transport> link_;
  Body body_;
  LoopHost host_;
  std::uint32_t heard_tick_ = 0, polled_tick_ = 0, unsent_ = 0;
  float deepest_N_ = 0.0f;
};

void tell(const HostEnd& host) {
  const LoopCounters counters = host.counters();
  std::cout << "session: " << counters.models_taken << " of " << counters.models_sent
            << " models taken over, tick " << host.heard_tick() << ", " << host.unsent()
            << " frames unsent\n";
}

TEST(KernelSession, WithTheFirmwareAtTheSameInterface) {
  const char* address = std::getenv("PALPATE_TEST_CAN");
  if (address == nullptr) GTEST_SKIP() << "PALPATE_TEST_CAN names no CAN interface";
  HostEnd host(address, TraceForm::full);
  const auto board_link = link::open_transport(address);
  plant::PlantParameters parameters;
  parameters.hand_kind = plant::HandKind::scripted;
  plant::Plant plant(parameters, plant::TipPath::minimum_jerk(
                                     {{0.1, {0.001, 0.002, -0.0195}}, {0.35, {0.001, 0.002, -0.023}}}));
  test::MemoryPeer board;
  EmulatedDevice device(plant, board);
  const auto latest = Clock::now() + kHangs;
  while (!(host.has_models() && host.is_felt()) && Clock::now() < latest) {
    device.receive(board_link->read(std::chrono::microseconds(0)));
    lockstep::ActuatorFrame actuators{};
    device.run(device.sensors(), actuators);
    if (actuators.link_length != 0) {
      EXPECT_TRUE(board_link->write(std::span(actuators.link).first(actuators.link_length)));
    }
    host.run(std::chrono::microseconds(0));
  }
  tell(host);
  EXPECT_TRUE(host.has_models() && host.is_felt());
  EXPECT_EQ(host.unsent(), 0u);
  EXPECT_EQ(host.counters().frames_lost_up, 0u);
  ASSERT_TRUE(host.status().has_value());
  EXPECT_EQ(host.status()->frames_lost, 0u);
  EXPECT_EQ(host.status()->frames_refused, 0u);
  EXPECT_EQ(host.status()->mode, palpate_BoardStatus_1_0_MODE_RENDER);
}

// Its force is known outside. The kernel here is emulated, and a driver gives a frame 20 ms: some may be
// lost, and what was in them is sent again. The board is left disarmed.
TEST(KernelSession, WithABoardElsewhere) {
  const char* address = std::getenv("PALPATE_TEST_BOARD");
  if (address == nullptr) GTEST_SKIP() << "PALPATE_TEST_BOARD names no board";
  constexpr std::uint32_t kPressed_tick = 400;
  // On a CAN bus there is no room for full ones.
  HostEnd host(address, kFraming == link::FramingKind::serial ? TraceForm::full : TraceForm::tip);
  const auto latest = Clock::now() + kHangs;
  while (!(host.has_models() && host.heard_tick() > kPressed_tick) && Clock::now() < latest)
    host.run(std::chrono::milliseconds(1));
  tell(host);
  EXPECT_TRUE(host.has_models());
  ASSERT_TRUE(host.status().has_value());
  EXPECT_EQ(host.status()->mode, palpate_BoardStatus_1_0_MODE_RENDER);
  host.disarm();
  while (host.status()->mode == palpate_BoardStatus_1_0_MODE_RENDER && Clock::now() < latest)
    host.run(std::chrono::milliseconds(1));
  EXPECT_EQ(host.status()->mode, palpate_BoardStatus_1_0_MODE_IDLE);
}

}  // namespace
}  // namespace palpate::host
