#include "boards/skeleton/no_arm.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "firmware/app/app.hpp"
#include "firmware/test_support.hpp"

namespace palpate::board {
namespace {

using firmware::test::HostPeer;
using firmware::test::MemoryBoard;

// A board in memory without encoders and amplifiers; its enable is what a port's pin would be.
struct SkeletonBoard : NoArm {
  MemoryBoard rest;
  int disables = 0;

  void isr_begin_tick(std::uint32_t tick) { rest.isr_begin_tick(tick); }
  void isr_end_tick(const firmware::TickReport& report) { rest.isr_end_tick(report); }
  bool isr_emergency_stop_open() { return rest.isr_emergency_stop_open(); }
  void isr_disable_amplifiers() { ++disables; }
  [[nodiscard]] std::uint32_t clock_count() const { return rest.clock_count(); }
  [[nodiscard]] std::uint32_t clock_Hz() const { return rest.clock_Hz(); }
  [[nodiscard]] std::uint32_t first_due_count() const { return rest.first_due_count(); }
  firmware::LinkBuffers& link() { return rest.link(); }
  void poll_receive() {}
  void start_transmit() {}
};
static_assert(firmware::BoardPort<SkeletonBoard>);

class NoArmTest : public ::testing::Test {
 protected:
  void tick() {
    app_->isr_tick();
    app_->background();
    host_.pump();
    board_->rest.now_count += MemoryBoard::kCountPerTick;
    ++ticks_;
  }
  std::uint8_t command(std::uint32_t action) {
    palpate_Command_Request_1_0 request{};
    request.action = static_cast<std::uint8_t>(action);
    host_.send(request);
    tick();
    tick();
    const auto responses = host_.take<palpate_Command_Response_1_0>();
    EXPECT_EQ(responses.size(), 1u);
    return responses.empty() ? 0 : responses.back().status;
  }
  void expect_a_fault_and_outputs_off() const {
    EXPECT_EQ(board_->rest.report.mode, static_cast<std::uint32_t>(firmware::Mode::fault));
    EXPECT_TRUE(board_->rest.report.faults & firmware::bit(firmware::Fault::not_a_number));
    EXPECT_TRUE(board_->rest.report.faults & firmware::bit(firmware::Fault::supply_low));
    EXPECT_EQ(board_->disables, ticks_);
  }

  std::unique_ptr<SkeletonBoard> board_ = std::make_unique<SkeletonBoard>();
  std::unique_ptr<firmware::App<SkeletonBoard>> app_ = std::make_unique<firmware::App<SkeletonBoard>>(
      *board_, firmware::BoardIdentity{"skeleton", "0", {1}}, firmware::kCatchUpCortexM4);
  HostPeer host_{board_->rest.buffers};
  int ticks_ = 0;
};

TEST_F(NoArmTest, FaultsFromTheFirstTickAndRefusesToArm) {
  tick();
  expect_a_fault_and_outputs_off();
  for (int i = 0; i < 100; ++i) tick();
  for (const std::uint32_t action :
       {palpate_Command_Request_1_0_ARM_REQUEST, palpate_Command_Request_1_0_ARM_DIRECT,
        palpate_Command_Request_1_0_CLEAR_FAULT, palpate_Command_Request_1_0_CALIBRATE}) {
    EXPECT_NE(command(action), 0) << action;
    expect_a_fault_and_outputs_off();
  }
}

}  // namespace
}  // namespace palpate::board
