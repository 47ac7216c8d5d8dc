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
#include <variant>
#include <vector>

#include "host/link/host_endpoint.hpp"
#include "host/link/known_boards.hpp"
#include "host/session/arming.hpp"
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
  constexpr int kNodes = 4;  // a body that keeps up with real time under a sanitizer, too
  LatticeSpec spec = test::reference_spec(kNodes);
  const double side_m = 0.01 * (kNodes - 1);
  spec.origin_m = {-0.5 * side_m, -0.5 * side_m, -0.02 - side_m};
  Body body = make_lattice(spec);
  BodyState start = body.rest_state();
  ClosedLoopConfig config;
  config.known_boards = {"memory"};
  config.session.friction.elsewhere = {0.5, 0.5};
  config.session.step_s = 2e-4;
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

// It renders for a host that was killed: the next one does not go on with what it has not begun.
TEST(AttachedLoop, DisarmsABoardThatItHasNotArmed) {
  const auto device = make_device("pty:");
  {
    const auto link = link::open_transport(device->address());
    link::HostEndpoint endpoint({.first_transfer_id = link::fresh_transfer_id()});
    Arming arming;
    const auto latest = std::chrono::steady_clock::now() + kHangs;
    for (std::uint32_t tick = 0; !device->state().outputs_on && std::chrono::steady_clock::now() < latest;
         ++tick) {
      for (const link::Incoming& incoming : endpoint.receive(link->read(1ms), tick)) {
        if (const auto* status = std::get_if<palpate_BoardStatus_1_0>(&incoming)) arming.take(*status);
        if (const auto* answer = std::get_if<link::CommandResponse>(&incoming)) arming.take(answer->message);
      }
      if (const auto request = arming.poll(tick)) link->write(endpoint.encode(*request).bytes);
    }
  }
  ASSERT_TRUE(device->state().outputs_on);
  AttachedLoop loop(setup(device->address()));
  loop.start();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_IDLE));
  EXPECT_FALSE(device->state().outputs_on);
}

// Over UDP nobody sees that the board has started again but by its ticks.
TEST(AttachedLoop, GoesOnWhereOnlyTheTicksSayThatTheBoardHasStartedAgain) {
  auto device = make_device("udp-listen:127.0.0.1:0");
  const std::string server = device->address();
  AttachedSetup with_delay = setup("udp" + server.substr(std::string("udp-listen").size()));
  with_delay.loop.host_delay_ticks = 20;  // a model is under way
  AttachedLoop loop(std::move(with_delay));
  loop.start();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_IDLE));
  loop.arm();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_RENDER));
  ASSERT_TRUE(
      until(loop, [](const LiveStatus& status, const auto&) { return status.tick > 2 * kOldest_ticks; }));
  device.reset();
  const std::uint32_t sent = loop.feed().status().counters.models_sent;
  device = make_device(server);
  ASSERT_TRUE(until(loop, [](const LiveStatus& status, const auto&) {
    return status.board && status.board->tick < kOldest_ticks && status.tick < kOldest_ticks;
  }));
  EXPECT_FALSE(device->state().outputs_on);
  // Models are made again, and news of them comes.
  (void)loop.feed().take_updates();
  ASSERT_TRUE(until(loop, [sent](const LiveStatus& status, const auto&) {
    return status.counters.models_sent > sent + 3;
  }));
  std::vector<UpdateRecord> updates;
  ASSERT_TRUE(until(loop, [&](const auto&, const auto&) {
    for (const UpdateRecord& update : loop.feed().take_updates()) updates.push_back(update);
    return std::any_of(updates.begin(), updates.end(), [](const UpdateRecord& update) {
      return update.status == static_cast<std::uint8_t>(Status::ok) && update.tick < 2 * kOldest_ticks;
    });
  }));
}

TEST(AttachedLoop, ArmsNoBoardThatItDoesNotKnow) {
  const auto device = make_device("pty:");
  AttachedSetup stranger = setup(device->address());
  stranger.loop.known_boards.clear();  // those of the project: MemoryPeer is none
  AttachedLoop loop(std::move(stranger));
  loop.start();
  ASSERT_TRUE(until_mode(loop, palpate_BoardStatus_1_0_MODE_IDLE));
  loop.arm();
  EXPECT_FALSE(until_mode(loop, palpate_BoardStatus_1_0_MODE_RENDER));
  const std::string error = loop.feed().status().error;
  EXPECT_NE(error.find(link::unknown_board_text("memory")), std::string::npos) << error;
  EXPECT_FALSE(device->state().outputs_on);
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
