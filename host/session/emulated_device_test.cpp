#include "host/session/emulated_device.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "host/session/test_board.hpp"
#include "host/session/test_drag.hpp"

namespace palpate::host {
namespace {

// Keeps what the board is sent.
class WatchedPeer final : public LockstepPeer {
 public:
  void send(const lockstep::SensorFrame& frame) override {
    sent.push_back({frame.tick, frame.flags, frame.link_length});
    board_.send(frame);
  }
  void receive(lockstep::ActuatorFrame& frame) override { board_.receive(frame); }

  struct Sent {
    std::uint32_t tick, flags, link_length;
    friend bool operator==(const Sent&, const Sent&) = default;
  };
  std::vector<Sent> sent;

 private:
  test::MemoryPeer board_;
};

// The board counts from 0 again, in boot, without what was on its line; the run's ticks go on.
TEST(EmulatedDevice, ABoardThatStartsAgainCountsFromZeroAndTheRunGoesOn) {
  constexpr std::uint32_t kBefore = 50, kAfter = 5;  // boot takes 20
  plant::Plant plant = test::drag_plant(-0.006);
  WatchedPeer board;
  EmulatedDevice device(plant, board);
  lockstep::ActuatorFrame actuators{};
  for (std::uint32_t i = 0; i < kBefore; ++i) device.run(device.sensors(), actuators);
  EXPECT_EQ(actuators.mode, static_cast<std::uint32_t>(firmware::Mode::idle));

  constexpr std::array<std::uint8_t, 3> kBytes{1, 2, 3};
  device.receive(kBytes);
  lockstep::SensorFrame sensors = device.sensors();
  device.receive(kBytes);
  sensors.flags |= lockstep::kReset;
  board.sent.clear();
  device.run(sensors, actuators);
  const std::vector<WatchedPeer::Sent> expected{{kBefore, lockstep::kReset, 3}, {0, 0, 0}};
  EXPECT_EQ(board.sent, expected);
  EXPECT_EQ(actuators.mode, static_cast<std::uint32_t>(firmware::Mode::boot));
  EXPECT_EQ(actuators.enabled, 0u);
  EXPECT_EQ(actuators.tick, kBefore);
  EXPECT_EQ(actuators.next_tick, kBefore + 1);

  for (std::uint32_t i = 1; i <= kAfter; ++i) {
    EXPECT_EQ(device.tick(), kBefore + i);
    device.run(device.sensors(), actuators);
    EXPECT_EQ(board.sent.back().tick, i);
    EXPECT_EQ(board.sent.back().link_length, 0u);
    EXPECT_EQ(actuators.tick, kBefore + i);
  }
  device.shut_down();
  EXPECT_EQ(board.sent.back().tick, kAfter + 1);
}

}  // namespace
}  // namespace palpate::host
