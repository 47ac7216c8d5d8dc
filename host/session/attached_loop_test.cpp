// The host in real time beside a board that runs by itself, at links of the operating system.
#include "host/session/attached_loop.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "host/session/test_board.hpp"
#include "host/session/test_contact.hpp"
#include "host/session/virtual_device.hpp"

namespace palpate::host {
namespace {

using namespace std::chrono_literals;

// Far longer than anything takes, even under a sanitizer on a busy machine.
constexpr auto kHangs = 300s;
constexpr Vec3d kAbove_m{0.0, 0.0, -0.018};
constexpr Vec3d kPressed_m{0.0, 0.0, -0.024};  // 4 mm in

std::unique_ptr<VirtualDevice> make_device(const std::string& link) {
  auto device = std::make_unique<VirtualDevice>(
      plant::PlantParameters{}, plant::TipPath::minimum_jerk({{0.0, kAbove_m}, {0.2, kPressed_m}}),
      std::make_unique<test::MemoryPeer>(), link::open_transport(link));
  device->start();
  return device;
}

// A block, its top at -2 cm; the hand 2 mm above it.
AttachedSetup setup(std::string address) {
  constexpr int kNodes = 7;
  LatticeSpec spec = test::reference_spec(kNodes);
  const double side_m = 0.01 * (kNodes - 1);
  spec.origin_m = {-0.5 * side_m, -0.5 * side_m, -0.02 - side_m};
  Body body = make_lattice(spec);
  BodyState start = body.rest_state();
  ClosedLoopConfig config;
  config.session.friction.elsewhere = {0.5, 0.5};
  return {.body = std::move(body),
          .start = std::move(start),
          .plant = {},
          .address = std::move(address),
          .loop = config};
}

// All that a loop has told since the call before; false when it hangs or has ended.
template <class Done>
bool until(AttachedLoop& loop, Done done) {
  const auto latest = std::chrono::steady_clock::now() + kHangs;
  while (std::chrono::steady_clock::now() < latest) {
    const LiveStatus status = loop.feed().status();
    const std::vector<LiveTick> ticks = loop.feed().take_ticks();
    if (done(status, ticks)) return true;
    if (!status.running) return false;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

bool until_mode(AttachedLoop& loop, std::uint8_t mode) {
  return until(loop, [mode](const LiveStatus& status, const auto&) {
    return status.board && status.board->mode == mode;
  });
}

bool until_it_presses(AttachedLoop& loop) {
  return until(loop, [](const LiveStatus&, const std::vector<LiveTick>& ticks) {
    return std::any_of(ticks.begin(), ticks.end(), [](const LiveTick& tick) {
      return tick.loop.board.force_N[2] < -0.3f && tick.loop.board.enabled != 0;
    });
  });
}

TEST(AttachedLoop, TheHandFeelsTheBody) {
  const auto device = make_device("pty:");
  AttachedLoop loop(setup(device->address()));
  loop.start();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_IDLE));
  loop.arm();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_RENDER));
  device->play_path();
  ASSERT_TRUE(until_it_presses(loop));
  const VirtualDeviceState state = device->state();
  EXPECT_TRUE(state.outputs_on);
  EXPECT_LT(state.hand_force_N.z, 0.0);  // the hand presses
  const LiveStatus status = loop.feed().status();
  EXPECT_GT(status.counters.models_taken, 0u);
  EXPECT_EQ(status.counters.frames_lost_up, 0u);
  EXPECT_EQ(status.links_opened, 1u);
  bool deformed = false;
  ASSERT_TRUE(until(loop, [&](const auto&, const auto&) {
    const auto picture = loop.feed().take_picture();
    if (picture)
      deformed = picture->state.position_m.row(2).maxCoeff() > -0.02 + 1e-9 ||
                 picture->state.velocity_m_s.norm() > 0.0;
    return deformed;
  }));
  loop.stop();
  EXPECT_EQ(loop.feed().status().error, "");
  const auto latest = std::chrono::steady_clock::now() + kHangs;
  while (device->state().outputs_on && std::chrono::steady_clock::now() < latest)
    std::this_thread::sleep_for(1ms);
  EXPECT_FALSE(device->state().outputs_on);
  EXPECT_EQ(device->state().mode, static_cast<std::uint32_t>(firmware::Mode::idle));
}

// The cable out and in again, a board that starts from its first tick at the other end.
TEST(AttachedLoop, GoesOnWithABoardThatHasStartedAgain) {
  const std::filesystem::path place =
      std::filesystem::temp_directory_path() / ("palpate_attached_" + std::to_string(::getpid()));
  const auto lead_to = [&place](const VirtualDevice& device) {
    std::filesystem::remove(place);
    std::filesystem::create_symlink(device.address().substr(std::string("serial:").size()), place);
  };
  auto device = make_device("pty:");
  lead_to(*device);
  AttachedLoop loop(setup("serial:" + place.string()));
  loop.start();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_IDLE));
  loop.arm();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_RENDER));
  device->play_path();
  ASSERT_TRUE(until_it_presses(loop));
  // Longer than kOldest_ticks, or its ticks could be late ones of the board before.
  ASSERT_TRUE(
      until(loop, [](const LiveStatus& status, const auto&) { return status.tick > 2 * kOldest_ticks; }));

  device.reset();
  ASSERT_TRUE(until(loop, [](const LiveStatus& status, const auto&) { return !status.link_is_open; }));
  const std::uint32_t taken = loop.feed().status().counters.models_taken;
  device = make_device("pty:");
  lead_to(*device);
  ASSERT_TRUE(until(loop, [](const LiveStatus& status, const auto&) {
    return status.link_is_open && status.board && status.board->tick < kOldest_ticks &&
           status.board->mode == palpate_BoardStatus_1_0_MODE_IDLE;
  }));
  EXPECT_EQ(loop.feed().status().links_opened, 2u);
  EXPECT_FALSE(device->state().outputs_on);  // nobody has armed this one
  loop.arm();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_RENDER));
  device->play_path();
  EXPECT_TRUE(until_it_presses(loop));
  EXPECT_GT(loop.feed().status().counters.models_taken, taken);
  loop.stop();
  EXPECT_EQ(loop.feed().status().error, "");
  std::filesystem::remove(place);
}

TEST(AttachedLoop, SaysWhyItCannotOpen) {
  EXPECT_THROW(AttachedLoop(setup("serial:/nowhere")), link::TransportError);
}

TEST(AttachedLoop, RefusesADelayOutOfRange) {
  const auto device = make_device("pty:");
  AttachedLoop loop(setup(device->address()));
  EXPECT_THROW(loop.set_host_delay(1001), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
