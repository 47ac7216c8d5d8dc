// The C library against the whole firmware with an arm and a hand, over links of the operating system.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>

#include "host/device_api/palpate_device.h"
#include "host/link/known_boards.hpp"
#include "host/link/transport.hpp"
#include "host/session/test_board.hpp"
#include "host/session/virtual_device.hpp"

namespace palpate {
namespace {

using namespace std::chrono_literals;

// Far longer than anything takes, even under a sanitizer on a busy machine.
constexpr auto kHangs = 120s;
constexpr double kWait_s = 20.0;
constexpr Vec3d kStart_m{0.0, 0.0, 0.0};
// float32 on the wire.
constexpr double kRounding = 1e-6;

// It calls itself as a board does that the library knows.
std::unique_ptr<host::VirtualDevice> make_device(const char* link, const char* name = "native") {
  auto device = std::make_unique<host::VirtualDevice>(
      plant::PlantParameters{}, plant::TipPath::minimum_jerk({{0.0, kStart_m}, {1.0, {0.0, 0.0, -0.02}}}),
      std::make_unique<host::test::MemoryPeer>(name), link::open_transport(link));
  device->start();
  return device;
}

// A device, and a program that has it open.
class DeviceApi : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    virtual_ = make_device(GetParam());
    std::string address = virtual_->address();
    if (const auto at = address.find("udp-listen"); at == 0) address = "udp" + address.substr(10);
    ASSERT_EQ(palpate_device_open(address.c_str(), &device_), PALPATE_OK) << palpate_device_error(nullptr);
  }
  void TearDown() override { palpate_device_close(device_); }

  palpate_device_state next() {
    palpate_device_state state{};
    EXPECT_EQ(palpate_device_wait(device_, kWait_s, &state), PALPATE_OK) << palpate_device_error(device_);
    return state;
  }
  palpate_result push(double x_N, double y_N, double z_N) {
    const double force_N[3] = {x_N, y_N, z_N};
    return palpate_device_set_force(device_, force_N);
  }
  // The same force after each state, for so many ticks of the board.
  palpate_device_state hold(double z_N, std::uint32_t ticks) {
    palpate_device_state state = next();
    for (const std::uint32_t begun = state.tick; state.tick - begun < ticks; state = next())
      EXPECT_EQ(push(0.0, 0.0, z_N), PALPATE_OK) << palpate_device_error(device_);
    return state;
  }
  template <class Done>
  bool until(Done done) {
    const auto begun = std::chrono::steady_clock::now();
    while (!done(next()))
      if (std::chrono::steady_clock::now() - begun > kHangs) return false;
    return true;
  }

  std::unique_ptr<host::VirtualDevice> virtual_;
  palpate_device* device_ = nullptr;
};

TEST_P(DeviceApi, SaysWhatItIsAndWhereItIs) {
  palpate_device_info info{};
  ASSERT_EQ(palpate_device_get_info(device_, &info), PALPATE_OK);
  EXPECT_STREQ(info.board, "native");
  EXPECT_EQ(info.tick_rate_Hz, 1000.0);
  EXPECT_EQ(info.max_force_N, static_cast<double>(firmware::Limits{}.direct_force_N));
  EXPECT_EQ(info.force_hold_s, 1e-3 * firmware::Limits{}.direct_hold_ticks);
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  const palpate_device_state state = next();
  EXPECT_EQ(state.faults, 0u);
  constexpr double kEncoder_m = 1e-4;  // counts of 0.03 mm
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(state.position_m[i], kStart_m[static_cast<std::size_t>(i)], kEncoder_m);
    EXPECT_EQ(state.force_N[i], 0.0);
  }
}

TEST_P(DeviceApi, TheHandFeelsTheForce) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  EXPECT_EQ(push(0.0, 0.0, 1.0), PALPATE_REFUSED);
  ASSERT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  hold(1.5, 400);
  // A computer that lets the program wait for 20 ms makes the force fade: then it comes again.
  ASSERT_TRUE(until([&](const palpate_device_state& s) {
    push(0.0, 0.0, 1.5);
    // Pushed up, where a hand that wants to stay gives way by some millimetres.
    return std::fabs(s.force_N[2] - 1.5) < kRounding && s.mode == PALPATE_MODE_DIRECT &&
           s.position_m[2] > 1e-4;
  }));
  const host::VirtualDeviceState truth = virtual_->state();
  EXPECT_TRUE(truth.outputs_on);
  EXPECT_LT(truth.hand_force_N.z, -0.5);  // the hand holds against it
}

TEST_P(DeviceApi, ForcesAreLimitedByTheBoard) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  ASSERT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  const double limit_N = static_cast<double>(firmware::Limits{}.direct_force_N);
  double largest_N = 0.0;
  ASSERT_TRUE(until([&](const palpate_device_state& s) {
    push(0.0, 0.0, 20.0);
    largest_N = std::max(largest_N, s.force_N[2]);
    return s.force_N[2] > limit_N - 1e-5;
  }));
  EXPECT_NEAR(largest_N, limit_N, 1e-5);
  EXPECT_EQ(next().faults, 0u);
}

TEST_P(DeviceApi, AProgramThatStopsLosesItsForceThenTheOutputs) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  ASSERT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  const std::uint32_t stopped = hold(1.0, 200).tick;
  const firmware::Limits limits{};
  // Two ticks from the last force sent to its arrival; one state a tick at most.
  const std::uint32_t zero_by = limits.direct_hold_ticks + limits.direct_fade_ticks + 4;
  ASSERT_TRUE(until([&](const palpate_device_state& s) { return s.tick - stopped > zero_by; }));
  EXPECT_EQ(next().force_N[2], 0.0);
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  // The last force may have left before the state that is taken for its own: a computer may let a program
  // wait.
  constexpr std::uint32_t kLate_ticks = 50;
  EXPECT_GT(next().tick - stopped + kLate_ticks, limits.direct_lost_ticks);
  EXPECT_EQ(push(0.0, 0.0, 1.0), PALPATE_REFUSED);
  EXPECT_NE(std::string(palpate_device_error(device_)).find("mode idle"), std::string::npos);
}

TEST_P(DeviceApi, FaultsAreSaidAndCleared) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  ASSERT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  virtual_->set_emergency_stop(true);
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_FAULT; }));
  EXPECT_EQ(next().faults, 1u);
  EXPECT_EQ(push(0.0, 0.0, 1.0), PALPATE_REFUSED);
  EXPECT_NE(
      std::string(palpate_device_error(device_)).find("mode fault, faults emergency_stop (docs/safety.md)"),
      std::string::npos);
  EXPECT_EQ(palpate_device_enable(device_), PALPATE_REFUSED);
  EXPECT_EQ(palpate_device_clear_fault(device_), PALPATE_REFUSED);
  virtual_->set_emergency_stop(false);
  ASSERT_TRUE(until([&](const palpate_device_state&) {
    return palpate_device_clear_fault(device_) == PALPATE_OK;  // the chain closes with the next tick
  }));
  EXPECT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  EXPECT_EQ(palpate_device_disable(device_), PALPATE_OK) << palpate_device_error(device_);
  EXPECT_EQ(next().mode, PALPATE_MODE_IDLE);
}

TEST_P(DeviceApi, ClosingSwitchesOff) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  ASSERT_EQ(palpate_device_enable(device_), PALPATE_OK) << palpate_device_error(device_);
  palpate_device_close(std::exchange(device_, nullptr));
  EXPECT_FALSE(virtual_->state().outputs_on);
}

TEST_P(DeviceApi, VelocityIsThatOfThePosition) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  virtual_->play_path();
  // The middle of 2 cm in 1 s, where the velocity is largest, 37.5 mm/s, and changes least.
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.position_m[2] < -0.008; }));
  const palpate_device_state first = next();
  palpate_device_state last = first;
  double mean_m_s = 0.0;
  int states = 0;
  while (last.tick - first.tick < 100) {
    last = next();
    mean_m_s += last.velocity_m_s[2];
    ++states;
  }
  mean_m_s /= states;
  const double true_m_s = (last.position_m[2] - first.position_m[2]) / (1e-3 * (last.tick - first.tick));
  EXPECT_LT(true_m_s, -0.02);
  // One encoder count at each end, 0.06 mm of 3 mm; states that went missing weigh the mean by some per cent.
  EXPECT_NEAR(mean_m_s, true_m_s, 0.1 * std::fabs(true_m_s));
}

TEST_P(DeviceApi, CalibratesAtRest) {
  ASSERT_TRUE(until([](const palpate_device_state& s) { return s.mode == PALPATE_MODE_IDLE; }));
  EXPECT_EQ(palpate_device_calibrate(device_), PALPATE_OK) << palpate_device_error(device_);
}

TEST_P(DeviceApi, RefusesBadArguments) {
  palpate_device_state state{};
  EXPECT_EQ(palpate_device_get_state(nullptr, &state), PALPATE_BAD_ARGUMENT);
  EXPECT_EQ(palpate_device_get_state(device_, nullptr), PALPATE_BAD_ARGUMENT);
  EXPECT_EQ(palpate_device_wait(device_, -1.0, &state), PALPATE_BAD_ARGUMENT);
  EXPECT_EQ(push(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0), PALPATE_BAD_ARGUMENT);
  EXPECT_NE(std::string(palpate_device_error(device_)).find("force_N[0]"), std::string::npos);
  EXPECT_EQ(push(0.0, 1e39, 0.0), PALPATE_BAD_ARGUMENT);
  EXPECT_EQ(palpate_device_set_force(device_, nullptr), PALPATE_BAD_ARGUMENT);
}

TEST_P(DeviceApi, ABoardThatGoesIsLost) {
  virtual_.reset();
  palpate_device_state state{};
  palpate_result result = PALPATE_OK;
  for (int i = 0; i < 100 && result == PALPATE_OK; ++i)
    result = palpate_device_wait(device_, kWait_s, &state);
  EXPECT_EQ(result, PALPATE_LOST);
  EXPECT_EQ(palpate_device_get_state(device_, &state), PALPATE_LOST);
  EXPECT_EQ(palpate_device_enable(device_), PALPATE_LOST);
}

INSTANTIATE_TEST_SUITE_P(Links, DeviceApi, ::testing::Values("pty:", "udp-listen:127.0.0.1:0"),
                         [](const auto& link) { return std::string(link.param).substr(0, 3); });

// A force must come before the one before it fades.
TEST(DeviceApiOpen, RefusesALineThatIsTooSlow) {
  const auto device = make_device("pty:");
  palpate_device* opened = nullptr;
  EXPECT_EQ(palpate_device_open((device->address() + ",9600").c_str(), &opened), PALPATE_CANNOT_OPEN);
  EXPECT_NE(std::string(palpate_device_error(nullptr)).find("too slow"), std::string::npos);
  ASSERT_EQ(palpate_device_open((device->address() + ",115200").c_str(), &opened), PALPATE_OK);
  palpate_device_info info{};
  EXPECT_EQ(palpate_device_get_info(opened, &info), PALPATE_OK);
  EXPECT_LT(info.state_rate_Hz, 200.0);
  EXPECT_GT(info.state_rate_Hz, 50.0);
  palpate_device_close(opened);
}

TEST(DeviceApiOpen, EnablesNoBoardThatItDoesNotKnow) {
  const auto device = make_device("pty:", "stranger");
  palpate_device* opened = nullptr;
  ASSERT_EQ(palpate_device_open(device->address().c_str(), &opened), PALPATE_OK)
      << palpate_device_error(nullptr);
  EXPECT_EQ(palpate_device_enable(opened), PALPATE_REFUSED);
  const std::string why = palpate_device_error(opened);
  EXPECT_NE(why.find(link::unknown_board_text("stranger")), std::string::npos) << why;
  // What does not move anything goes on.
  palpate_device_state state{};
  EXPECT_EQ(palpate_device_wait(opened, kWait_s, &state), PALPATE_OK);
  EXPECT_FALSE(device->state().outputs_on);
  palpate_device_close(opened);
}

TEST(DeviceApiOpen, SaysWhyItCannot) {
  palpate_device* device = reinterpret_cast<palpate_device*>(&device);
  EXPECT_EQ(palpate_device_open(nullptr, &device), PALPATE_BAD_ARGUMENT);
  EXPECT_EQ(device, nullptr);
  EXPECT_EQ(palpate_device_open("serial:/nowhere", &device), PALPATE_CANNOT_OPEN);
  EXPECT_NE(std::string(palpate_device_error(nullptr)).find("/nowhere"), std::string::npos);
  const auto nobody = link::open_transport("pty:");
  EXPECT_EQ(palpate_device_open(nobody->address().c_str(), &device), PALPATE_NO_BOARD);
  EXPECT_EQ(device, nullptr);
  palpate_device_close(nullptr);
}

}  // namespace
}  // namespace palpate
